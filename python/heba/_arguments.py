"""What several functions share: configs, settings, runs and threads as arguments, calls that can be interrupted, and tables."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
import re
import tempfile
import threading
from pathlib import Path
from typing import Any, Callable, Iterator, Mapping, Sequence, TypeVar, Union

from . import _heba
from ._heba import Error
from ._result import Result

PathLike = Union[str, "os.PathLike[str]"]
Settings = Union[Sequence[str], Mapping[str, Any]]
Found = TypeVar("Found")


def entries_of(settings: Settings) -> list[str]:
    """Returns settings as entries "KEY=VALUE"."""
    if not isinstance(settings, Mapping):
        return list(settings)
    entries = []
    for key, value in settings.items():
        if isinstance(value, Mapping):
            entries += [f"{key}.{entry}" for entry in entries_of(value)]
        else:
            # JSON is YAML.
            entries.append(f"{key}={value if isinstance(value, str) else json.dumps(value, default=os.fspath)}")
    return entries


def threads_of(threads: int | None) -> int:
    if threads is None:
        return len(os.sched_getaffinity(0))
    if threads < 1:
        raise Error("threads: must be at least 1")
    return threads


@contextlib.contextmanager
def config_file(config: PathLike | Mapping[str, Any], *, has_name: bool = True) -> Iterator[str]:
    """Gives the path of a config; a dictionary has a file as long as it is used, and a name if its form has one."""
    if not isinstance(config, Mapping):
        try:
            yield os.fspath(config)
        except Error as error:
            raise Error(_own_words(str(error))) from None
        return
    # Paths in a config are relative to its folder.
    handle, path = tempfile.mkstemp(suffix=".yaml", prefix=".heba-", dir=os.getcwd())
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            json.dump({**({"name": "config"} if has_name else {}), **config}, file, default=os.fspath)
        yield path
    except Error as error:
        # The file is heba's own, and all of it is one line.
        raise Error(re.sub(re.escape(path) + r"(:\d+)*", "config", _own_words(str(error)))) from None
    finally:
        os.unlink(path)


def folder_of(run: PathLike | Result, what: str) -> Path:
    """Returns the folder of a run, or of its result."""
    if not isinstance(run, Result):
        return Path(run)
    if run.folder is None:
        raise Error(f"a result of arrays has no folder; {what} needs one of a run")
    return run.folder


def rows_of(text: str) -> tuple[dict[str, Any], ...]:
    """Returns the rows of a table as CSV: numbers where a cell is one, None where it is empty."""
    return tuple({key: _value(value) for key, value in row.items()} for row in csv.DictReader(io.StringIO(text)))


def _value(text: str) -> Any:
    if text == "":
        return None
    try:
        return float(text)
    except ValueError:
        return text


def interruptible(call: Callable[[_heba.Cancellation], Found]) -> Found:
    """Calls in another thread, so that an interrupt from the keyboard ends the wait at once, and the call at its next step."""
    cancellation = _heba.Cancellation()
    found: list[Found] = []
    raised: list[BaseException] = []

    def work() -> None:
        try:
            found.append(call(cancellation))
        except BaseException as error:  # Is raised again in the thread that waits.
            raised.append(error)

    worker = threading.Thread(target=work, name="heba")
    try:
        worker.start()
        while worker.is_alive():
            worker.join(0.1)
    except BaseException:
        cancellation.request()
        raise
    if raised:
        raise raised[0]
    return found[0]


def _own_words(message: str) -> str:
    """Names the argument in place of the flag of the program."""
    return re.sub(r"^--set\b", "settings", message)
