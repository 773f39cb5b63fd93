#!/usr/bin/env bash
# A batch and a study as job arrays on a real Slurm of one node, started here with a config folder of its own and stopped by
# process number; then a batch whose node dies in mid-array. The summaries must be the bytes that one machine gives.
# Skips (77) where Slurm is not installed or cannot be started by this user.
set -euo pipefail
build=$1
source=$2
heba=$build/heba

skip() { echo "skipped: $*"; exit 77; }
for program in munged slurmctld slurmd sbatch squeue sinfo scontrol; do
  command -v "$program" >/dev/null || PATH=$PATH:/usr/sbin
  command -v "$program" >/dev/null || skip "$program is not installed (Debian: slurm-wlm, munge)"
done
[ "$(id -u)" -eq 0 ] || skip "Slurm's daemons are started as root here"

work=$(mktemp -d /tmp/heba_slurm.XXXXXX)
chmod 755 "$work"
export SLURM_CONF=$work/slurm.conf
export HEBA_CACHE=
pids=()
# Our own processes and those that they have started, by number.
kill_tree() {
  local child
  for child in $(ps -o pid= --ppid "$1" 2>/dev/null); do kill_tree "$child"; done
  kill -9 "$1" 2>/dev/null || true
}
# The steps' daemons leave their parent, but carry our config in their environment.
kill_steps() {
  local step
  for step in $(pgrep -x slurmstepd || true); do
    if { tr '\0' '\n' <"/proc/$step/environ"; } 2>/dev/null | grep -q "^SLURM_CONF=$work/"; then kill_tree "$step"; fi
  done
}
finish() {
  status=$?
  for pid in "${pids[@]}"; do kill_tree "$pid"; done
  kill_steps
  if [ $status -ne 0 ] && [ $status -ne 77 ]; then tail -n 20 "$work"/*.log || true; fi
  rm -rf "$work"
  exit $status
}
trap finish EXIT

fail() { echo "FAILED: $*"; exit 1; }
wait_for() {  # SECONDS COMMAND...
  local end=$((SECONDS + $1))
  shift
  until "$@" >/dev/null 2>&1; do
    [ $SECONDS -lt $end ] || return 1
    sleep 0.3
  done
}

host=$(hostname -s)
port=$((20000 + RANDOM % 20000))
mkdir -p "$work/munge" "$work/state" "$work/spool"
chmod 700 "$work/munge"
head -c 1024 /dev/urandom >"$work/munge/key"
chmod 400 "$work/munge/key"
cat >"$SLURM_CONF" <<CONF
ClusterName=heba
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$port
SlurmdPort=$((port + 1))
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$work/munge/socket
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SlurmdParameters=config_overrides
ReturnToService=2
SlurmdTimeout=5
KillWait=1
JobRequeue=1
NodeName=$host NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF

munged --foreground --force --key-file="$work/munge/key" --socket="$work/munge/socket" --pid-file="$work/munge/pid" \
  --log-file="$work/munge/log" --seed-file="$work/munge/seed" >"$work/munged.log" 2>&1 &
pids+=($!)
disown
wait_for 10 test -S "$work/munge/socket" || skip "munged does not start here"
slurmctld -D >"$work/slurmctld.out.log" 2>&1 &
pids+=($!)
disown
start_node() {
  slurmd -D >>"$work/slurmd.out.log" 2>&1 &
  node=$!
  pids+=("$node")
  disown
}
start_node
node_is_up() { sinfo -h -o %T | grep -qE '^(idle|mixed|allocated)$'; }
wait_for 30 node_is_up || { tail -n 5 "$work"/slurm*.log; skip "Slurm does not start here"; }
queue_is_empty() { [ -z "$(squeue -h)" ]; }

# Six small runs, and one of a rig.
cat >"$work/scene.yaml" <<'SCENE'
setup: eye_to_hand
target: {type: chessboard, rows: 5, columns: 7, square: 20 mm}
camera: {model: brown5, image_size: [640, 480], fx: 700, fy: 700, cx: 320, cy: 240, distortion: [0, 0, 0, 0, 0]}
hand_eye: {translation: [820 mm, -140 mm, 610 mm], rpy: [-118 deg, 4 deg, 62 deg]}
board: {translation: [-70 mm, -60 mm, 95 mm], rpy: [3 deg, -2 deg, 15 deg]}
motion: {captures: 8, distance: 420 mm, tilt: 35 deg, spin: 60 deg, spread: 0.3}
image: {noise: 2 grey}
SCENE
"$heba" simulate "$work/scene.yaml" --out "$work/data" --quiet
configs=()
for loss in none huber cauchy; do
  for groups in '[]' '[focal]'; do
    config=$work/${loss}_${#configs[@]}.yaml
    printf 'base: data/config.yaml\nrefine: {loss: %s, intrinsics: %s}\nevaluate: {folds: 2}\n' "$loss" "$groups" >"$config"
    configs+=("$config")
  done
done
cat >"$work/rig_scene.yaml" <<'SCENE'
cameras:
  left:
    mount: world
    pose: {translation: [500 mm, 600 mm, 700 mm], rpy: [-110 deg, 0 deg, 175 deg]}
    camera: &camera {model: brown5, image_size: [640, 480], fx: 600, fy: 600, cx: 320, cy: 240, distortion: [0, 0, 0, 0, 0]}
  right:
    mount: world
    pose: {translation: [700 mm, 550 mm, 600 mm], rpy: [-105 deg, 0 deg, 165 deg]}
    camera: *camera
targets:
  plate:
    mount: gripper
    pose: {translation: [0 mm, -50 mm, 80 mm], rpy: [90 deg, 0 deg, 0 deg]}
    target: {type: charuco, rows: 6, columns: 8, square: 22 mm, marker: 16 mm, dictionary: DICT_4X4_250}
motion: {captures: 10, distance: 600 mm, tilt: 30 deg}
image: {noise: 2 grey}
SCENE
"$heba" simulate "$work/rig_scene.yaml" --out "$work/rig_data" --quiet
printf 'base: rig_data/config.yaml\nrefine: {intrinsics: []}\nevaluate: {folds: 2}\n' >"$work/rig.yaml"
configs+=("$work/rig.yaml")
"$heba" run "${configs[@]}" --out "$work/one_machine" --quiet

echo "an array of a batch"
"$source/tools/slurm/submit.sh" --tasks 3 --heba "$heba" --cpus-per-task=1 -- run "${configs[@]}" --out "$work/array%j" >/dev/null
wait_for 120 queue_is_empty || fail "the array does not end"
cmp "$work/array%j/summary.csv" "$work/one_machine/summary.csv" || fail "the array's summary is another"

echo "a node that dies in mid-array"
submitted=$("$source/tools/slurm/submit.sh" --tasks ${#configs[@]} --heba "$heba" --cpus-per-task=1 -- run "${configs[@]}" --out "$work/killed")
array=${submitted%% *}
some_are_done() { [ "$(find "$work/killed" -name result.json 2>/dev/null | wc -l)" -ge 2 ]; }
wait_for 60 some_are_done || fail "nothing gets done"
done_before=$(find "$work/killed" -name result.json | sort)
[ "$(echo "$done_before" | wc -l)" -lt ${#configs[@]} ] || fail "the array was done before its node could die"
# The daemon first, then what it has started.
kill -9 "$node"
kill_steps
stamps=$(stat -c '%n %Y %i' $done_before)
node_is_down() { sinfo -h -o %T | grep -q '^down'; }
wait_for 60 node_is_down || fail "Slurm does not see that its node is dead"
start_node
wait_for 60 node_is_up || fail "the node does not come back"
# What was taken down waits for a while before it may start again.
for job in $(squeue -h -r -o %i -t PD | grep "^$array" || true); do scontrol update JobId="$job" StartTime=now || true; done
wait_for 300 queue_is_empty || { squeue; fail "the array does not go on"; }
cmp "$work/killed/summary.csv" "$work/one_machine/summary.csv" || fail "the summary after the node's death is another"
[ "$(stat -c '%n %Y %i' $done_before)" = "$stamps" ] || fail "what was finished was done again"
[ -z "$(find "$work/killed" -name '*.part*')" ] || fail "half-written files were left"

echo "an array of a study"
printf 'trials: 3\nscenes: {four: %s}\npixel_noise: [0.1 px, 0.5 px, 1 px]\nmethods: [shah]\n' \
  "$source/configs/scenes/ring4_eye_to_hand.yaml" >"$work/study.yaml"
"$heba" study "$work/study.yaml" --out "$work/study_one" --quiet
"$source/tools/slurm/submit.sh" --tasks 2 --heba "$heba" -- study "$work/study.yaml" --out "$work/study_array" >/dev/null
wait_for 120 queue_is_empty || fail "the study's array does not end"
cmp "$work/study_array/study.csv" "$work/study_one/study.csv" || fail "the study's figures are others"

# The same command again does nothing but look.
"$source/tools/slurm/submit.sh" --tasks 3 --heba "$heba" -- run "${configs[@]}" --out "$work/killed" >/dev/null
wait_for 120 queue_is_empty || fail "the second submission does not end"
[ "$(stat -c '%n %Y %i' $done_before)" = "$stamps" ] || fail "the second submission did what was done"
echo "passed"
