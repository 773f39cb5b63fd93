"""The build backend of `pip install .` (PEP 517), in Python's standard library alone, so that it works offline.

It builds the extension with CMake for the interpreter that runs it, and packs the package as a wheel. The wheel uses the
shared libraries of the machine, so it is for this machine and others with the same packages of Debian.

    pip install . --no-index --config-settings build-dir=build/release    # with an existing build folder
"""

import base64
import hashlib
import os
import re
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

SOURCE = Path(__file__).resolve().parent.parent


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """Builds the extension and writes the wheel; returns its name."""
    settings = config_settings or {}
    build = Path(settings.get("build-dir", SOURCE / "build" / "wheel")).resolve()
    options = [
        "-DCMAKE_BUILD_TYPE=Release",
        "-DHEBA_BUILD_TESTS=OFF",
        "-DHEBA_BUILD_PYTHON=ON",
        "-DHEBA_UNITE=ON",
        f"-DPython3_EXECUTABLE={sys.executable}",
    ]
    if not (build / "CMakeCache.txt").exists():
        subprocess.run(["cmake", "-G", "Ninja", "-S", SOURCE, "-B", build, *options], check=True)
    subprocess.run(["cmake", "--build", build, "--target", "heba_python"], check=True)
    return pack(build / "python" / "heba", Path(wheel_directory))


def get_requires_for_build_wheel(config_settings=None):
    return []


def build_sdist(sdist_directory, config_settings=None):
    """Archives the files that git knows."""
    name = f"heba-{version()}"
    archive = Path(sdist_directory) / f"{name}.tar.gz"
    subprocess.run(
        ["git", "-C", SOURCE, "archive", "--format=tar.gz", f"--prefix={name}/", "-o", archive, "HEAD"], check=True
    )
    return archive.name


def version():
    """Returns the version that CMakeLists.txt states."""
    return re.search(r"project\(heba VERSION ([0-9.]+)", (SOURCE / "CMakeLists.txt").read_text()).group(1)


def pack(package, wheel_directory, platform=None, more=None):
    """Packs the folder of a built package as a wheel; returns the wheel's name.

    `platform` is the tag of the machines that it is for, by default this one; `more` has further files by their paths.
    """
    extension = next(package.glob("_heba*.so"), None)
    if extension is None or not extension.name.endswith(sysconfig.get_config_var("EXT_SUFFIX")):
        raise SystemExit(f"{package}: has no extension for {sys.executable}; build it with -DPython3_EXECUTABLE")
    machine = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    tag = "cp{0}{1}-cp{0}{1}-{2}".format(*sys.version_info[:2], platform or machine)
    info = f"heba-{version()}.dist-info"
    metadata = (
        f"Metadata-Version: 2.1\nName: heba\nVersion: {version()}\nSummary: Hand-eye bundle adjustment\n"
        "License: see LICENSE\nRequires-Python: >=3.9\n"
        # Runs of configs need no numpy, so that it is an extra: `pip install --no-index` works where there is none.
        'Provides-Extra: numpy\nRequires-Dist: numpy; extra == "numpy"\n'
    )
    files = {
        f"heba/{file.name}": file.read_bytes()
        for file in sorted(package.iterdir())
        if file == extension or file.suffix in (".py", ".pyi", ".typed") or file.name == "py.typed"
    }
    files |= more or {}
    files[f"{info}/METADATA"] = metadata.encode()
    files[f"{info}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: heba\nRoot-Is-Purelib: false\nTag: {tag}\n".encode()
    files[f"{info}/LICENSE"] = (SOURCE / "LICENSE").read_bytes()
    record = "".join(f"{name},sha256={_digest(data)},{len(data)}\n" for name, data in files.items())
    files[f"{info}/RECORD"] = (record + f"{info}/RECORD,,\n").encode()
    wheel = wheel_directory / f"heba-{version()}-{tag}.whl"
    staged = wheel.with_suffix(".part")
    with zipfile.ZipFile(staged, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            entry.external_attr = (0o755 if ".so" in Path(name).name else 0o644) << 16
            archive.writestr(entry, data, zipfile.ZIP_DEFLATED)
    os.replace(staged, wheel)
    return wheel.name


def _digest(data):
    return base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()


if __name__ == "__main__":
    print(pack(Path(sys.argv[1]), Path(sys.argv[2])))
