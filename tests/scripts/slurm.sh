#!/bin/sh
# The manual's Slurm job array on a cluster of two virtual nodes on this machine: six parts, one node fails during the work,
# its parts are requeued, a dependent job merges them.  The table is, byte for byte, that of a single sweep.  Skipped without
# Slurm (`make deps TOOLS=slurm`).  Reads PINWHEEL.

for program in slurmctld slurmd munged sbatch scontrol; do
  command -v $program >/dev/null || [ -x /usr/sbin/$program ] || {
    echo "[  SKIPPED ] Slurm: $program is not installed"
    exit 0
  }
done
. "$(dirname "$0")/../support/report.sh"
PATH=$PATH:/usr/sbin
host=$(hostname -s) top=$work
stop () {
  for pid in "$top"/*.pid; do [ ! -f "$pid" ] || kill "$(cat "$pid")" 2>/dev/null; done
  pkill -KILL -f "$top/" 2>/dev/null
  for pid in "$top"/*.pid; do # the daemons write files until they end, and then remove these
    tries=0
    while [ -f "$pid" ] && kill -0 "$(cat "$pid")" 2>/dev/null && [ $((tries += 1)) -le 100 ]; do sleep 0.1; done
  done
  rm -rf "$top"
}
trap stop EXIT

# ---- The cluster ----

mkdir "$work/munge" "$work/state"
chmod 755 "$work" "$work/munge"
(umask 077 && head -c 1024 /dev/urandom >"$work/munge/key")
munged --force --key-file="$work/munge/key" --socket="$work/munge/socket" --pid-file="$work/munge.pid" \
  --log-file="$work/munge/log" --seed-file="$work/munge/seed" >"$work/log" 2>&1
report 'munge starts' $?
cat >"$work/slurm.conf" <<CONF
ClusterName=pinwheel
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=16817
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
AuthType=auth/munge
AuthInfo=socket=$work/munge/socket
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool-%n
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd-%n.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd-%n.log
ProctrackType=proctrack/pgid
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SlurmdParameters=config_overrides
ReturnToService=2
SchedulerParameters=sched_interval=2,batch_sched_delay=1
NodeName=one NodeHostname=$host NodeAddr=127.0.0.1 Port=16821 CPUs=2 State=UNKNOWN
NodeName=two NodeHostname=$host NodeAddr=127.0.0.1 Port=16822 CPUs=2 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES State=UP
CONF
export SLURM_CONF="$work/slurm.conf"

# wait_for SECONDS COMMAND...: until it succeeds.
wait_for () {
  tries=$(($1 * 5))
  shift
  until "$@"; do
    tries=$((tries - 1))
    [ $tries -gt 0 ] || return 1
    sleep 0.2
  done
}
idle () { [ "$(sinfo -h -t idle -o %D 2>/dev/null)" = "$1" ]; }
ended () { left=$(squeue -h -j "$1" 2>/dev/null) && [ -z "$left" ]; } # no answer is not an end
{ slurmctld -c && slurmd -N one && slurmd -N two && wait_for 60 idle 2; } >"$work/log" 2>&1
report 'two nodes are idle' $?

# ---- The job of the manual, with a smaller grid ----

manual=docs/manual.md grid='--vary omega=1:10:12 --vary M0=0.01:1:10:log --t-end 500 --lanes 1'
sed -n '/^    #!\/bin\/sh$/,/^$/s/^    //p' "$manual" | sed -e 's/array=1-16/array=1-6/' -e 's|TASK_ID/16|TASK_ID/6|' \
  -e "s|--vary omega=.* --vary M0=[^ ]*|$grid|" -e 's/cpus-per-task=8/cpus-per-task=1/' >"$work/job.sh"
merge=$(sed -n "s/^    sbatch --dependency=.* --wrap '\(.*\)'$/\1/p" "$manual")
grep -q 'array=1-6' "$work/job.sh" && grep -q 'requeue' "$work/job.sh" && grep -q 'omega=1:10:12' "$work/job.sh" && [ -n "$merge" ]
report 'the manual has the job' $?
PATH=$(dirname "$pinwheel"):$PATH
"$pinwheel" sweep ezyroller $grid -o "$work/whole.csv" >"$work/log" 2>&1
report 'one sweep' $?

cd "$work" || exit 1
job=$(sbatch --parsable job.sh) && sbatch --parsable --dependency="afterok:$job" --wrap "$merge" >"$work/merge" 2>"$work/log"
report 'the array is submitted' $?

# Node two fails in the middle of its parts: their processes and its daemon die, then Slurm learns that it is down and
# requeues them.
on_two () { squeue -h -r -j "$job" -t running -w two -o "$1"; }
busy () { for part in $(on_two %K); do [ -s "part-$part.csv.part" ] && return; done; return 1; }
wait_for 60 busy
report 'a part runs on node two' $?
parts=$(on_two %K) jobs=$(on_two %A)
kill -KILL "$(cat slurmd-two.pid)"
for id in $jobs; do pkill -KILL -f "slurmstepd: \[$id\."; done
for part in $parts; do pkill -KILL -f -- "--part $part/6"; done
unfinished=0
for part in $parts; do [ -e "part-$part.csv.part" ] && [ ! -e "part-$part.csv" ] && unfinished=1; done
echo "parts of node two: $parts" >"$work/log"
[ $unfinished = 1 ]
report 'it is unfinished' $?
scontrol update nodename=two state=down reason=failed
slurmd -N two
# Slurm holds requeued jobs back for two minutes; they need not wait that long here.
requeued () { [ -z "$(on_two %K)" ] && scontrol update jobid="$job" starttime=now; }
wait_for 20 requeued 2>/dev/null
wait_for 180 ended "$job,$(cat merge)"
squeue >"$work/log" 2>&1
report 'all jobs end' $?
cat slurm-*.out >"$work/log" 2>/dev/null
cmp table.csv whole.csv >>"$work/log" 2>&1
report 'the merged table has the bytes of one sweep' $?
exit $bad
