#!/usr/bin/env bash
# The include structure: a folder includes only folders below it, and within a folder a room includes only rooms that
# stand before it in its list. docs/architecture.md draws the same lists.
set -uo pipefail
cd "$(dirname "$0")/../.."
status=0
# forbid FOLDER REGEX WHY
forbid() {
  if grep -rnE --include='*.h' --include='*.cc' --include='*.def' "^#include [<\"]($2)" "$1"; then
    echo "^ $1 must not include that: $3"
    status=1
  fi
}
forbid src 'opencv2|apriltag|cairo|gflags|solvers/|targets/|tools/|python/|tests/' 'the core includes nothing above it'
forbid solvers 'opencv2|apriltag|cairo|gflags|targets/|tools/|python/|tests/' 'solvers include the core only'
forbid targets 'gflags|solvers/|tools/|python/|tests/' 'targets include the core only'
forbid tools 'python/|tests/' 'the application does not include its tests or its Python module'
# public FOLDER: the public headers of a folder above the core, which are named heba/x.h.
public() { (cd "$1" && printf '%s|' heba/*.h | sed 's/[|]$//'); }
forbid src "($(public solvers/include)|$(public targets/include)|$(public tools/run/include))" 'the core includes nothing above it'
forbid solvers "($(public targets/include)|$(public tools/run/include))" 'solvers include the core only'
forbid targets "($(public solvers/include)|$(public tools/run/include))" 'targets include the core only'
for room in closed_form residuals uncertainty; do
  forbid solvers/$room 'heba/(bundle_adjustment|calibration|cross_validation|target_location)\.h' 'that room stands above it'
done
for room in refine initial; do
  forbid solvers/$room 'heba/(calibration|cross_validation|target_location)\.h' 'that room stands above it'
done

# rooms FOLDER PREFIX ROOM...: the rooms of a folder, each of which may include those before it. The room '.' is the
# files directly in the folder.
rooms() {
  local folder=$1 prefix=$2
  shift 2
  local rooms=("$@") i j file
  for i in "${!rooms[@]}"; do
    for ((j = i + 1; j < ${#rooms[@]}; ++j)); do
      local above="$prefix${rooms[j]}/[^\"]*" inside=(-r "$folder/${rooms[i]}")
      [ "${rooms[j]}" = . ] && above="$prefix[^/\"]*"
      [ "${rooms[i]}" = . ] && inside=(-d skip "$folder"/*.*)
      if grep -nE --include='*.h' --include='*.cc' --include='*.def' "^#include \"$above\"" "${inside[@]}"; then
        echo "^ $folder/${rooms[i]} must not include $folder/${rooms[j]}"
        status=1
      fi
    done
  done
  for file in "$folder"/*/; do
    case " ${rooms[*]} bench cmake include slurm " in
      *" $(basename "$file") "*) ;;
      *) echo "$file is not in the list of rooms"; status=1 ;;
    esac
  done
}
rooms src/heba heba/ base kernels geometry camera data config robot evaluation io simulation
rooms solvers solvers/ closed_form residuals uncertainty refine initial calibration rig
rooms targets targets/ images . dots render corners tags types
rooms tools tools/ run text files config pages doctor batch study cli .

# Libraries print nothing and read no flags.
if grep -rnE --include='*.h' --include='*.cc' 'std::(cout|cerr)|[^sn]printf\(|FLAGS_' src solvers targets | grep -v snprintf; then
  echo "^ libraries print nothing and read no flags"
  status=1
fi
exit $status
