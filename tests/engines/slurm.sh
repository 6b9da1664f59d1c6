#!/usr/bin/env bash
# A campaign under Slurm with two nodes on this one machine: the same bytes as one process, also after a task was killed with -9, after a
# node was lost, after tasks found the disk full, and where both nodes ran every part at the same time.
#
#   tests/engines/slurm.sh                as root, with Debian's slurm-wlm and munge
#
# Ends with 77 where Slurm is not installed or cannot be started. COILWRIGHT_PROGRAM, CELLS and MOVES change what is run.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

for part in slurmctld slurmd sbatch munged; do
  command -v "$part" >/dev/null || { echo "skipped: Slurm is not installed ($part is missing)"; exit 77; }
done
[ "$(id -u)" = 0 ] || { echo "skipped: Slurm's daemons are started as root"; exit 77; }

work=$(mktemp -d)
chmod 755 "$work"
started=()
ended() {
  local code=$?
  for process in "${started[@]}"; do kill "$process" 2>/dev/null || true; done
  for process in "${started[@]}"; do wait "$process" 2>/dev/null || true; done
  mountpoint -q "$work/full/results" && umount "$work/full/results"
  [ $code = 0 ] || tail -n 20 "$work"/*.log 2>/dev/null
  rm -rf "$work"
}
trap ended EXIT
. tests/engines/grid.sh

# A key, a socket and daemons of our own: nothing of the machine's is touched.
mkdir -p "$work/munge" "$work/state" "$work/spool-n1" "$work/spool-n2"
chmod 700 "$work/munge"
head -c 1024 /dev/urandom >"$work/munge/key"; chmod 400 "$work/munge/key"
munged --foreground --force --key-file="$work/munge/key" --socket="$work/munge/socket" --pid-file="$work/munge/pid" \
  --log-file="$work/munge/log" --seed-file="$work/munge/seed" >"$work/munged.log" 2>&1 & started+=($!)
host=$(hostname -s)
cat >"$work/slurm.conf" <<CONF
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=16817
AuthType=auth/munge
AuthInfo=socket=$work/munge/socket
CredType=cred/munge
SlurmUser=root
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool-%n
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd-%n.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerType=sched/backfill
SchedulerParameters=sched_interval=1,batch_sched_delay=0
MpiDefault=none
ReturnToService=2
SlurmdTimeout=10
MinJobAge=600
NodeName=n1 NodeHostname=$host NodeAddr=127.0.0.1 Port=17001 CPUs=2 RealMemory=4000
NodeName=n2 NodeHostname=$host NodeAddr=127.0.0.1 Port=17002 CPUs=2 RealMemory=4000
PartitionName=all Nodes=n1,n2 Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$work/slurm.conf
slurmctld -D >"$work/slurmctld.log" 2>&1 & started+=($!)
slurmd -D -N n1 >"$work/slurmd-n1.log" 2>&1 & started+=($!)
slurmd -D -N n2 >"$work/slurmd-n2.log" 2>&1 & second=$!; started+=($second)
for _ in $(seq 60); do
  [ "$(sinfo -h -N -o %t 2>/dev/null | grep -c idle)" = 2 ] && break
  sleep 1
done
[ "$(sinfo -h -N -o %t | grep -c idle)" = 2 ] || { sinfo -N || true; echo "skipped: Slurm's two nodes do not start here"; tail -n 5 "$work"/slurm*.log; exit 77; }

emit() { "$program" campaign "$work/grid.toml" --emit slurm -o "$work/$1" --job-time "${JOB_TIME:-300ms}" --quiet; }
submitted() { (cd "$work/$1" && bash submit.sh "${@:2}") | tee >(cat >&2) | sed 's/.*table: job //'; }
# Until the last job has ended.
ended_well() {
  local began=$SECONDS
  for _ in $(seq "${PATIENCE_S:-300}"); do
    [ -z "$(squeue -h -j "$1" 2>/dev/null)" ] && break
    sleep 1
  done
  scontrol show job "$1" | grep -q 'JobState=COMPLETED' || { scontrol show job "$1" | grep -E 'JobState|Reason'; cat "$work/$2/logs/"* | tail -n 20; fail "$3"; }
  same "$work/$2/results" "$3 ($((SECONDS - began)) s)"
}

emit plain
ended_well "$(submitted plain)" plain "two nodes, $cells cells"

# Every part on both nodes at once, so that each cell is computed by two tasks; the second only adds tasks, the table is one.
emit twice
mkdir -p "$work/twice/logs"
(cd "$work/twice" && . ./campaign.conf && sbatch --parsable --nodelist=n2 --array="1-$parts" --output=logs/again-%a.log array.sh >again)
table=$(submitted twice --nodelist=n1)
ended_well "$table" twice "every cell twice at once"
while [ -n "$(squeue -h -j "$(cat "$work/twice/again")" 2>/dev/null)" ]; do sleep 1; done
rm -rf "$work/twice/results/unfinished"
same "$work/twice/results" "the same after the second run of every cell"

# A disk that is full until a task has failed on it.
emit full
mkdir -p "$work/full/results"
if mount -t tmpfs -o size=64m tmpfs "$work/full/results"; then
  cat >"$work/starved" <<SH
#!/bin/bash
"$program" "\$@"; code=\$?
[ \$code = 2 ] && { echo full >>"$work/was-full"; rm -f results/.balloon; }
exit \$code
SH
  chmod +x "$work/starved"
  sed -i "s|^program=.*|program='$work/starved'|" "$work/full/campaign.conf"
  dd if=/dev/zero of="$work/full/results/.balloon" bs=64k 2>/dev/null || true
  ended_well "$(submitted full)" full "a full disk"
  [ -s "$work/was-full" ] || fail "no task found the disk full"
  echo "$(wc -l <"$work/was-full") tasks had found the disk full"
else
  echo "skipped: no file system of its own can be mounted here"
fi

# A task is killed, then a node is lost while its tasks run.
emit faults
table=$(submitted faults)
for _ in $(seq 100); do
  victim=$(pgrep -f "campaign $work/grid.toml -o results --shard" | head -n 1 || true)
  [ -n "$victim" ] && kill -9 "$victim" 2>/dev/null && echo "killed a task's program with -9" && break
  sleep 0.1
done
[ -n "$victim" ] || fail "no task was seen to be killed"
for _ in $(seq 100); do
  lost=$(squeue -h -t running -w n2 -o %i | head -n 1)
  [ -n "$lost" ] && break
  sleep 0.1
done
[ -n "$lost" ] || fail "no task ran on the second node"
kill -9 "$second"
# With a node go its tasks.
for step in $(pgrep -f 'slurmstepd: \['"${lost%%_*}" || true); do
  tr '\0' '\n' <"/proc/$step/environ" 2>/dev/null | grep -q '^SLURMD_NODENAME=n2' && kill -9 "$step" || true
done
scontrol update nodename=n2 state=down reason=lost
echo "lost n2 while $lost ran on it"
ended_well "$table" faults "a task killed with -9 and a node lost"
