#!/usr/bin/env bash
# Installs the Debian packages that heba needs, those that are missing only. Needs root or sudo if any is. With
# `--tests` those too that only its tests and benchmarks need, with `--wheel` those that make a wheel portable.
set -euo pipefail

# What differs between Debian's releases: 13 has no clang 14, and other versions format and warn differently.
case "$(. /etc/os-release && echo "${VERSION_ID-}")" in
  13) compiler=() checkers=() ;;
  *) compiler=(clang-14) checkers=(clang-format-14 clang-tidy-14) ;;
esac

packages=(
  g++ "${compiler[@]}" cmake ninja-build pkg-config
  libeigen3-dev libceres-dev libgoogle-glog-dev libgflags-dev libyaml-cpp-dev nlohmann-json3-dev
  libopencv-core-dev libopencv-imgproc-dev libopencv-calib3d-dev
  libapriltag-dev libcairo2-dev libqrencode-dev libxxhash-dev zlib1g-dev
  libpng-dev libjpeg-dev libtiff-dev liburdfdom-dev libconsole-bridge-dev
  python3-dev python3-numpy pybind11-dev
)
# Node.js and npm in whatever way they came; the pages' charts are bundled with them.
if ! command -v node >/dev/null || ! command -v npm >/dev/null; then packages+=(nodejs npm); fi
if [ "${1-}" = "--tests" ]; then
  # Tests and benchmarks compare with OpenCV's contrib modules.
  packages+=(libgtest-dev libgmock-dev libbenchmark-dev "${checkers[@]}" libopencv-dev libopencv-contrib-dev
    slurm-wlm munge procps chromium valgrind patchelf python3-pytest python3-matplotlib python3-opencv python3-venv)
fi

if [ "${1-}" = "--wheel" ]; then packages+=(binutils patchelf); fi

missing=()
for package in "${packages[@]}"; do
  if ! dpkg-query -W -f='${db:Status-Abbrev}' "$package" 2>/dev/null | grep -q '^ii'; then
    missing+=("$package")
  fi
done
if [ ${#missing[@]} -eq 0 ]; then exit 0; fi

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo >/dev/null; then
    echo "missing packages: ${missing[*]}; install them as root, or install sudo" >&2
    exit 1
  fi
  as_root=(sudo)
fi
echo "installing: ${missing[*]}"
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
