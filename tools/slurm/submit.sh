#!/usr/bin/env bash
# Submits a batch or a study as a Slurm job array, and a job after it that puts the parts together:
#
#   tools/slurm/submit.sh [--tasks N] [--heba PROGRAM] [SBATCH-OPTION...] -- run CONFIG... --out DIR [FLAG...]
#   tools/slurm/submit.sh [--tasks N] [--heba PROGRAM] [SBATCH-OPTION...] -- study STUDY.yaml --out DIR [FLAG...]
#
# Task I does the part I of N (`--shard I/N`) with as many threads as the task has processors. All tasks write into DIR,
# which every node must see under the same path, as it must the program, the configs and the images. Tasks that a node
# takes down with it are queued again by Slurm, and leave alone what was finished (`--resume`); so does everything when
# the same command is submitted again: only what failed or is missing is done. Logs go to DIR.slurm.
#
# Prints two job numbers: the array's, and that of the job after it, whose exit status is the batch's.
set -euo pipefail

tasks=4
heba=$(command -v heba || true)
options=()
while [ $# -gt 0 ] && [ "$1" != "--" ]; do
  case $1 in
    --tasks) tasks=$2; shift 2 ;;
    --heba) heba=$2; shift 2 ;;
    *) options+=("$1"); shift ;;
  esac
done
[ $# -gt 0 ] && shift
if [ $# -lt 2 ] || ! [[ $1 =~ ^(run|study)$ ]]; then
  sed -n '4,5s/^# *//p' "$0" >&2
  exit 2
fi
if ! [[ $tasks =~ ^[1-9][0-9]*$ ]]; then
  echo "--tasks needs a number from 1, not '$tasks'" >&2
  exit 2
fi
if [ -z "$heba" ] || [ ! -x "$heba" ]; then
  echo "there is no program heba in PATH; name it with --heba" >&2
  exit 2
fi

out=
for ((i = 1; i <= $#; ++i)); do
  case ${!i} in
    --out) next=$((i + 1)); out=${!next-} ;;
    --out=*) out=${!i#--out=} ;;
    --shard* | --jobs*) echo "${!i} is for this script to say" >&2; exit 2 ;;
  esac
done
if [ -z "$out" ]; then
  echo "--out DIR is needed: the parts must meet somewhere" >&2
  exit 2
fi
logs=${out%/}.slurm
mkdir -p "$logs"
# A % in a path would be a pattern of Slurm.
log_pattern=${logs//%/%%}

# As one word each, whatever they hold.
command=$(printf '%q ' "$heba" "$@" --resume --quiet)
script() { printf '#!/usr/bin/env bash\nexec %s --jobs "${SLURM_CPUS_PER_TASK:-1}" %s\n' "$command" "$1"; }

array=$(script "--shard \"\$SLURM_ARRAY_TASK_ID/$tasks\"" |
  sbatch --parsable --job-name=heba --requeue --open-mode=append --array="0-$((tasks - 1))" \
    --output="$log_pattern/%A_%a.log" ${options[@]+"${options[@]}"})
merge=$(script "--shard 0/1" |
  sbatch --parsable --job-name=heba-merge --requeue --open-mode=append --dependency="afterany:${array%%;*}" \
    --output="$log_pattern/%j.log" ${options[@]+"${options[@]}"})
echo "${array%%;*} ${merge%%;*}"
