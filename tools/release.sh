#!/usr/bin/env bash
# Makes the files of a release in build/release_files, and tries each: the source archive, the Debian package, the wheel,
# and their checksums. The checkout must be clean. Needs root or sudo for the packages that are missing.
set -euo pipefail
cd "$(dirname "$0")/.."

version=$(sed -nE 's/^project\(heba VERSION ([0-9.]+) .*/\1/p' CMakeLists.txt)
fail() { echo "release: $1" >&2; exit 1; }
[ -z "$(git status --porcelain)" ] || fail "the checkout has changes that are not committed"
grep -q "<version>$version</version>" package.xml || fail "package.xml has another version than CMakeLists.txt, $version"
grep -q "^## $version" CHANGELOG.md || fail "CHANGELOG.md has no section $version"

rm -rf build/release_files
mkdir -p build/release_files
files=$PWD/build/release_files
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

archive=$files/heba-$version.tar.gz
git archive --format=tar.gz --prefix="heba-$version/" --output="$archive" HEAD
tar -xzf "$archive" -C "$work"
[ "$(git ls-files | wc -l)" = "$(find "$work/heba-$version" -type f -o -type l | wc -l)" ] ||
  fail "$archive does not have all files of the checkout"

cp "$(tools/package.sh | tail -n 1)" "$files"
package=$(ls "$files"/*.deb)
[ "$(dpkg-deb --field "$package" Version)" = "$version" ] || fail "$package has another version than $version"
dpkg-deb --extract "$package" "$work/package"
installed=$work/package/usr/bin/heba
"$installed" --version | grep -qF "heba $version" || fail "$package has a program of another version"
"$installed" simulate configs/sample_scene.yaml --out "$work/cell" --quiet
"$installed" run "$work/cell/config.yaml" --out "$work/run" --quiet --fail-on doubtful >/dev/null ||
  fail "the program of $package does not calibrate the sample"

cp "$(tools/wheel.sh build/package | tail -n 1)" "$files"
wheel=$(ls "$files"/*.whl)
/usr/bin/python3 -m venv --system-site-packages "$work/venv"
"$work/venv/bin/pip" install --quiet --no-index --no-deps "$wheel"
(cd "$work" && venv/bin/python - "$version" <<'PYTHON') || fail "the module of $wheel does not calibrate the sample"
import sys

import heba

assert heba.__version__ == sys.argv[1], heba.__version__
assert heba.run("cell/config.yaml", out="run_of_wheel").verdict["grade"] == "good"
PYTHON

cd "$files"
sha256sum ./*.tar.gz ./*.deb ./*.whl >SHA256SUMS
ls -l "$files"
