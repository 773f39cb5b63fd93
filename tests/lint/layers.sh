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
rooms solvers solvers/ closed_form residuals uncertainty refine initial calibration cell study
rooms targets targets/ images . dots render corners tags types
rooms tools tools/ run text files config pages doctor pipeline study batch cli .

# Python and the benchmarks stand beside the program and do not need it.
for folder in python tools/bench; do
  forbid $folder 'tools/(batch|cli)/' 'it uses the libraries below the program'
done
if grep -nE '(python|bench).*heba_program' python/CMakeLists.txt tools/CMakeLists.txt; then
  echo "^ Python and the benchmarks do not link the program"
  status=1
fi

# No arrow runs back up inside a room either: of two files (x.h together with x.cc), one may include the other, directly or
# through others, but not each the other.
find src solvers targets tools \( -name '*.h' -o -name '*.cc' -o -name '*.def' \) | awk '
  { files[NR] = $0; name = $0; sub(/.*\//, "", name); if (name ~ /[.]cc$/) sources[name] = sources[name] " " $0 }
  END {
    for (i in files) {
      file = files[i]; as_included = file; part = file
      sub(/[.](h|cc|def)$/, "", part)
      if (file ~ /^src\//) sub(/^src\//, "", as_included)
      if (match(file, /\/include\/heba\//)) {
        # A public header belongs to the source of its name in the same folder.
        as_included = substr(file, RSTART + 9)
        folder = substr(file, 1, RSTART)
        name = file; sub(/.*\//, "", name); sub(/[.]h$/, ".cc", name)
        count = split(sources[name], found, " ")
        for (k = 1; k <= count; ++k) if (index(found[k], folder) == 1) { part = found[k]; sub(/[.]cc$/, "", part) }
      }
      part_of[as_included] = part; part_of_file[file] = part
    }
    for (i in files) {
      while ((getline line < files[i]) > 0) {
        if (line !~ /^#include "/) continue
        sub(/^#include "/, "", line); sub(/".*/, "", line)
        if (line in part_of && part_of[line] != part_of_file[files[i]]) print part_of_file[files[i]], part_of[line]
      }
      close(files[i])
    }
  }' | tsort 2>&1 >/dev/null | sed 's/^tsort: -: input contains a loop:/^ these include each other:/; s/^tsort: //' >"${TMPDIR:-/tmp}/loops.$$"
if [ -s "${TMPDIR:-/tmp}/loops.$$" ]; then
  cat "${TMPDIR:-/tmp}/loops.$$"
  status=1
fi
rm -f "${TMPDIR:-/tmp}/loops.$$"

# Libraries print nothing and read no flags.
if grep -rnE --include='*.h' --include='*.cc' 'std::(cout|cerr)|[^sn]printf\(|FLAGS_' src solvers targets | grep -v snprintf; then
  echo "^ libraries print nothing and read no flags"
  status=1
fi
exit $status
