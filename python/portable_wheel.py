"""Makes a wheel that other distributions of Linux can use out of one that uses the libraries of this machine.

    python3 python/portable_wheel.py heba-0.1.0-cp311-cp311-linux_x86_64.whl FOLDER

The shared libraries that the extension needs are put beside it, under names of their own, so that no library of the
user's machine or of another wheel takes their place. The C library, and those that come with the compiler, are left to
the user's machine: the tag of the wheel (PEP 600) says how new they must be, by the newest versions of their symbols
that any file of the wheel needs. Each bundled library brings its licence. Needs patchelf and binutils.
"""

import hashlib
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import build_backend

# The libraries of every machine: glibc, and the run-time libraries of the compiler.
OF_EVERY_MACHINE = re.compile(
    r"(linux-vdso|ld-linux[-a-z0-9]*|libc|libm|libdl|librt|libpthread|libutil|libresolv|libnsl|libgcc_s|libstdc\+\+)\.so\b"
)
# The version of glibc with which distributions come that have libstdc++ with these symbols (Debian, Fedora, Ubuntu).
GLIBC_OF_GLIBCXX = ((28, 31), (29, 34), (30, 35), (32, 38), (33, 39), (34, 42))


def run(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def libraries_of(extension):
    """Returns the paths of all libraries that a file needs, by the names under which it needs them."""
    paths = {}
    for line in run("ldd", str(extension)).splitlines():
        name, _, path = line.strip().partition(" => ")
        if OF_EVERY_MACHINE.match(Path(name.split()[0]).name):
            continue
        if not path or path.startswith("not found"):
            raise SystemExit(f"{extension}: needs {name}, which is not there")
        paths[name] = Path(path.rsplit(" (", 1)[0])
    return paths


def needed_by(file):
    return run("patchelf", "--print-needed", str(file)).split()


def newest_glibc(files):
    """Returns N of the oldest glibc 2.N with which all files work."""
    newest = 17
    for file in files:
        symbols = run("objdump", "-T", str(file))
        newest = max([newest, *(int(minor) for minor in re.findall(r"\bGLIBC_2\.(\d+)", symbols))])
        glibcxx = max((int(minor) for minor in re.findall(r"\bGLIBCXX_3\.4\.(\d+)", symbols)), default=0)
        newest = max([newest, *(glibc for least, glibc in GLIBC_OF_GLIBCXX if glibcxx >= least)])
    return newest


def licence_of(library):
    """Returns the package of a library, and its copyright file."""
    # Packages that are older than the union of /lib and /usr/lib know their files by the former.
    path = library.resolve()
    for path in (path, Path("/", *path.parts[2:])):
        found = subprocess.run(["dpkg-query", "-S", str(path)], capture_output=True, text=True)
        if found.returncode == 0:
            package = found.stdout.split(":")[0]
            return package, Path("/usr/share/doc") / package / "copyright"
    raise SystemExit(f"{library}: belongs to no package, so that its licence is not known")


def bundle(package, libraries):
    """Copies the libraries beside the extension and leads it to them; returns the copies."""
    folder = package.parent / "heba.libs"
    folder.mkdir()
    name_of = {}
    for name, path in libraries.items():
        digest = hashlib.sha256(path.read_bytes()).hexdigest()[:8]
        stem, _, rest = name.partition(".so")
        name_of[name] = f"{stem}-{digest}.so{rest}"
        shutil.copyfile(path, folder / name_of[name])
        (folder / name_of[name]).chmod(0o755)
    copies = [folder / name for name in name_of.values()]
    extension = next(package.glob("_heba*.so"))
    for file in [extension, *copies]:
        # patchelf 0.14 makes one change at a time.
        for name in needed_by(file):
            if name in name_of:
                run("patchelf", "--replace-needed", name, name_of[name], str(file))
        if file != extension:
            run("patchelf", "--set-soname", file.name, str(file))
        rpath = "$ORIGIN/../heba.libs" if file == extension else "$ORIGIN"
        run("patchelf", "--force-rpath", "--set-rpath", rpath, str(file))
    return copies


def make_portable(wheel, folder):
    """Writes the portable wheel; returns its path."""
    with tempfile.TemporaryDirectory() as staging:
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(staging)
        package = Path(staging) / "heba"
        extension = next(package.glob("_heba*.so"))
        libraries = libraries_of(extension)
        licences = dict(licence_of(path) for path in libraries.values())
        copies = bundle(package, libraries)
        platform = f"manylinux_2_{newest_glibc([extension, *copies])}_{wheel.stem.split('linux_')[-1]}"
        more = {f"heba.libs/{file.name}": file.read_bytes() for file in copies}
        more |= {f"heba.libs/licences/{name}.txt": file.read_bytes() for name, file in sorted(licences.items())}
        return folder / build_backend.pack(package, folder, platform, more)


if __name__ == "__main__":
    print(make_portable(Path(sys.argv[1]), Path(sys.argv[2])))
