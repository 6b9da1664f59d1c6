"""Writes python/THIRD-PARTY-LICENCES.md: what the wheel and the program are built of, under which licence, with its text.

    python3 .ci/third_party_licences.py            writes the file
    python3 .ci/third_party_licences.py --check    says whether it is that of Cargo.lock
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TARGET = ROOT / "python" / "THIRD-PARTY-LICENCES.md"


def packages() -> list[dict]:
    """What the Python module is built of besides this repository, sorted; what only tests or builds need left out."""
    done = subprocess.run(
        ["cargo", "metadata", "--format-version", "1", "--locked", "--all-features", "--manifest-path", str(ROOT / "python" / "Cargo.toml")],
        check=True,
        capture_output=True,
        text=True,
    )
    metadata = json.loads(done.stdout)
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    (root,) = (p["id"] for p in metadata["packages"] if p["name"] == "coilwright-python")
    reached, ahead = set(), [root]
    while ahead:
        at = ahead.pop()
        if at in reached:
            continue
        reached.add(at)
        for dependency in nodes[at]["deps"]:
            if any(kind["kind"] is None for kind in dependency["dep_kinds"]):
                ahead.append(dependency["pkg"])
    found = [p for p in metadata["packages"] if p["id"] in reached and p["source"]]
    return sorted(found, key=lambda p: (p["name"], p["version"]))


def texts(package: dict) -> list[str]:
    """The licence texts that a package brings."""
    folder = Path(package["manifest_path"]).parent
    names = ("licen", "copying", "notice", "unlicense")
    files = sorted(f for f in folder.iterdir() if f.is_file() and f.name.lower().startswith(names))
    return ["\n".join(line.rstrip() for line in f.read_text("utf-8", "replace").strip().splitlines()) for f in files]


def head(found: list[dict]) -> str:
    rows = [f"| {p['name']} | {p['version']} | {p['license'] or 'see its text'} | {p['repository'] or ''} |" for p in found]
    return "\n".join(
        [
            "# Third-party licences",
            "",
            "What the wheel and the program are built of, besides this repository. Written by `.ci/third_party_licences.py`.",
            "",
            "| package | version | licence | source |",
            "|---|---|---|---|",
            *rows,
            "",
        ]
    )


def main() -> int:
    found = packages()
    if "--check" in sys.argv[1:]:
        kept = TARGET.read_text("utf-8") if TARGET.is_file() else ""
        if kept.startswith(head(found)):
            return 0
        print(f"{TARGET.name} is not that of Cargo.lock: run python3 .ci/third_party_licences.py", file=sys.stderr)
        return 1
    by_text: dict[str, list[str]] = {}
    for package in found:
        for text in texts(package):
            by_text.setdefault(text, []).append(f"{package['name']} {package['version']}")
    parts = [head(found), "# Texts", ""]
    for text, whose in by_text.items():
        parts += ["## " + ", ".join(whose), "", "```text", text.replace("```", "'''"), "```", ""]
    TARGET.write_text("\n".join(parts), "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
