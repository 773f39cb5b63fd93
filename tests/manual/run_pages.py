#!/usr/bin/env python3
"""Runs every command on pages of the manual and compares its output with the page's.

    run_pages.py PROGRAM SOURCE [--update] [--without-commands=NAME.md]... PAGE.md...

Each page runs in a folder of its own that holds a copy of `configs` and has `heba` on its path. In the page,
- a block ```sh is run by bash, all of its lines together; the ```text block directly after it is the output that is
  expected, standard output and errors together; a ```text block anywhere else is a fault;
- a block ```python is run by the Python that runs this program; the code of a page shares its names;
- `<!-- file: NAME -->` before a block writes the block to that file;
- `<!-- before: COMMAND -->` runs a command that the page does not show;
- `<!-- status: N -->` before an ```sh block states the exit status, which is otherwise 0;
- `<!-- not run: REASON -->` before a block leaves it out, and the reason is printed;
- `<!-- not compared: REASON -->` before a ```text block states that it is no output, and the reason is printed;
- `<!-- needs: NAME -->` links the recorded data set NAME (HEBA_DATA_DIR, or shared/data beside the source) as
  recorded/NAME; without it, the rest of the page is skipped and the name is printed.

A page without a command is a fault, unless --without-commands names it; a page that is named must have none.

Numbers with decimals may differ by 3 %, by one unit of the last digit that the page shows, or by two if these are at
most 20 %; numbers with an exponent by 3 %, or by two units of the last digit if these are at most 20 %. The sign must
be the same. In a text block, `...` alone on a line stands for any lines and at the end of a line for any rest. --update
writes the outputs into the blocks without `...`.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
RELATIVE = 0.03
RELATIVE_OF_UNITS = 0.2
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
COMMENT = re.compile(r"^<!-- (file|before|status|not run|not compared|needs)(?:: (.*?))? -->$", re.MULTILINE)


def is_near(shown, actual):
    """Returns true if a number agrees with the number on the page, to the digits that are shown there."""
    if shown == actual:
        return True
    expected, other = float(shown), float(actual)
    mantissa, has_exponent, exponent = shown.partition("e")
    digits = len(mantissa.partition(".")[2])
    # Whole numbers are often counts, which must be exact.
    if expected * other < 0 or not (digits or has_exponent):
        return expected == other
    unit = 10.0 ** (int(exponent or 0) - digits)
    tolerance = max(RELATIVE * abs(expected), min(2 * unit, RELATIVE_OF_UNITS * abs(expected)))
    if not has_exponent:
        tolerance = max(tolerance, unit)
    return abs(other - expected) <= tolerance * (1 + 1e-9)


def agrees(shown, actual):
    """Returns true if a line of output agrees with the line on the page."""
    rest = shown.endswith("...")
    if rest:
        shown = shown[:-3].rstrip()
    pattern = [NUMBER.split(line) for line in (shown, actual)]
    numbers = [NUMBER.findall(line) for line in (shown, actual)]
    words = [[" ".join(text.split()) for text in texts] for texts in pattern]
    if rest:
        count = len(numbers[0])
        if len(numbers[1]) < count or not words[1][count].startswith(words[0][-1]):
            return False
        words = [words[0][:-1], words[1][:count]]
        numbers[1] = numbers[1][:count]
    return (
        words[0] == words[1]
        and len(numbers[0]) == len(numbers[1])
        and all(is_near(a, b) for a, b in zip(numbers[0], numbers[1]))
    )


def first_difference(shown, actual):
    """Returns the first line of the page that the output does not have, or of the output beyond the page; or None."""
    at = 0
    skipping = False
    for line in shown:
        if line.strip() == "...":
            skipping = True
            continue
        while skipping and at < len(actual) and not agrees(line, actual[at]):
            at += 1
        if at >= len(actual) or not agrees(line, actual[at]):
            return f"the page has   {line}\nthe output has {actual[at] if at < len(actual) else '(nothing)'}"
        skipping = False
        at += 1
    if at < len(actual) and not skipping:
        return f"the output has one more line: {actual[at]}"
    return None


def lines_of(text):
    return [line.rstrip() for line in text.strip("\n").split("\n")]


class Page:
    def __init__(self, file, source, folder):
        self.file, self.source, self.folder = file, source, folder
        self.text = file.read_text()
        self.names = {}
        self.commands = 0
        self.is_skipped = False  # True if the rest of the page needs a data set that is not there.
        self.faults = []
        self.notes = []
        shutil.copytree(source / "configs", folder / "configs")

    def fail(self, place, fault):
        line = self.text.count("\n", 0, place) + 1
        self.faults.append(f"{self.file}:{line}: {fault}")

    def shell(self, code):
        done = subprocess.run(
            ["bash", "-e", "-o", "pipefail", "-c", code],
            cwd=self.folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            timeout=600,
        )
        output = done.stdout.decode(errors="replace").split("\n")
        # A line of progress that was overwritten is not seen by the user.
        output = "\n".join(line.rpartition("\r")[2] for line in output)
        return done.returncode, output.replace(str(self.folder) + "/", "")

    def python(self, code, place):
        script = compile("\n" * self.text.count("\n", 0, place) + code, str(self.file), "exec")
        before, printed = os.getcwd(), sys.stdout
        os.chdir(self.folder)
        with tempfile.TemporaryFile("w+") as stream:
            sys.stdout = stream
            try:
                exec(script, self.names)
            finally:
                sys.stdout = printed
                os.chdir(before)
            stream.seek(0)
            return stream.read()

    def link(self, name):
        data = Path(os.environ.get("HEBA_DATA_DIR", self.source.parent / "shared" / "data")) / name
        if not data.exists():
            self.notes.append(f"skipped from here on: the recorded data set {name} is not there ({data})")
            return False
        (self.folder / "recorded").mkdir(exist_ok=True)
        (self.folder / "recorded" / name).symlink_to(data.resolve())
        return True

    def run(self, update):
        """Runs the page's blocks in their order."""
        items = [(m.start(), m, None) for m in COMMENT.finditer(self.text)]
        items += [(m.start(), None, m) for m in FENCE.finditer(self.text)]
        directives = {}
        output = None  # That of the block before, if only blank lines are between.
        end = 0
        changes = []
        for place, comment, block in sorted(items, key=lambda item: item[0]):
            if self.text[end:place].strip():
                output = None
                directives = {}
            end = (comment or block).end()
            if comment:
                name, value = comment.groups()
                if name == "before":
                    status, printed = self.shell(value)
                    if status != 0:
                        self.fail(place, f"'{value}' ends with status {status}:\n{printed}")
                elif name == "needs":
                    if not self.link(value):
                        self.is_skipped = True
                        break
                else:
                    directives[name] = value
                continue
            language, code = block.groups()
            if "file" in directives:
                path = self.folder / directives["file"]
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(code)
            elif "not run" in directives:
                self.notes.append(f"not run ({directives['not run']}): {lines_of(code)[0]}")
            elif language == "sh":
                self.commands += sum(
                    1 for line in lines_of(code.replace("\\\n", " ")) if line.strip() and line.strip()[0] != "#"
                )
                status, output = self.shell(code)
                expected = int(directives.get("status", 0))
                if status != expected:
                    self.fail(place, f"the status is {status}, not {expected}:\n{output}")
                directives = {}
                continue
            elif language == "python":
                self.commands += 1
                output = ""
                try:
                    output = self.python(code, place)
                except KeyboardInterrupt:
                    raise
                except BaseException as error:  # The page's code may raise anything, SystemExit too.
                    self.fail(place, f"the code raises {type(error).__name__}: {error}")
                directives = {}
                continue
            elif "not compared" in directives:
                self.notes.append(f"not compared ({directives['not compared']}): {lines_of(code)[0]}")
            elif language == "text" and output is None:
                self.fail(place, "the text block does not follow a command, so nothing is compared with it")
            elif language == "text":
                difference = first_difference(lines_of(code), lines_of(output))
                if update and not any(line.endswith("...") for line in lines_of(code)):
                    changes.append((block.start(2), block.end(2), "\n".join(lines_of(output)) + "\n"))
                elif difference:
                    self.fail(place, f"the output differs:\n{difference}\n--- the output is\n{output}---")
            output = None
            directives = {}
        for begin, finish, text in reversed(changes):
            self.text = self.text[:begin] + text + self.text[finish:]
        if changes:
            self.file.write_text(self.text)


def main(arguments):
    update = "--update" in arguments
    flag = "--without-commands="
    without = {word[len(flag) :] for word in arguments if word.startswith(flag)}
    program, source, *files = [Path(word).resolve() for word in arguments if not word.startswith("--")]
    commands = 0
    faults = []
    with tempfile.TemporaryDirectory() as folder:
        os.environ.update(PATH=f"{program.parent}:{os.environ['PATH']}", HEBA_CACHE=f"{folder}/cache")
        for number, file in enumerate(files):
            work = Path(folder) / f"page{number}"
            page = Page(file, source, work)
            page.run(update)
            if page.commands == 0 and not page.is_skipped and file.name not in without:
                page.fail(0, "the page has no command; --without-commands states that it needs none")
            if page.commands > 0 and file.name in without:
                page.fail(0, "the page has commands, but --without-commands names it")
            commands += page.commands
            faults += page.faults
            for note in page.notes:
                print(f"{file.name}: {note}")
            print(f"{file.name}: {page.commands} commands, {len(page.faults)} faults")
            shutil.rmtree(work)
    print("\n".join(faults))
    print(f"{commands} commands on {len(files)} pages, {len(faults)} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
