# What the tests of both engines share: the program, a campaign of cells that take half a second each with a debug build, and the
# bytes that one process leaves. Sourced, with $work set to an empty folder.

program=${COILWRIGHT_PROGRAM:-$PWD/target/debug/coilwright}
cells=${CELLS:-16}
moves=${MOVES:-500}
[ -x "$program" ] || { echo "no program at $program: cargo build first" >&2; exit 2; }
fail() { echo "FAILED: $*" >&2; exit 1; }

# Two profiles (PROFILES=2) are enough where many cells are compared.
sed "s/^count = .*/count = ${PROFILES:-64}/" examples/paper-200m.toml >"$work/paper.toml"
cat >"$work/grid.toml" <<TOML
name = "engine"
models = ["paper.toml"]
layers = [8, 12]
classes = ["standard", "any"]
seeds = [$(seq -s , 1 $((cells / 4)))]
rounds = 1
moves_per_restart = $moves
TOML
"$program" campaign "$work/grid.toml" -o "$work/one" --quiet >/dev/null

# Every file of a campaign, but what an interrupted cell left.
bytes() { (cd "$1" && find . -type f ! -path './unfinished/*' ! -name '.*' | sort | xargs sha256sum); }
same() {
  [ "$(bytes "$work/one")" = "$(bytes "$1")" ] || { diff <(bytes "$work/one") <(bytes "$1") | head; fail "$2: other bytes than one process"; }
  echo "ok: $2"
}
