"""numpy, imported when it is first used: runs of configs, their verdicts and tables, and the doctor need none."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any, Callable, TypeVar

if TYPE_CHECKING:
    import numpy as np
else:

    class _Numpy:
        def __getattr__(self, name: str) -> Any:
            import numpy

            return getattr(numpy, name)

    np = _Numpy()

Function = TypeVar("Function", bound=Callable[..., Any])


def needs_numpy(function: Function) -> Function:
    """Makes a function of the package raise an ImportError of one line where there is no numpy."""

    @functools.wraps(function)
    def checked(*args: Any, **kwargs: Any) -> Any:
        try:
            import numpy  # noqa: F401
        except ImportError as error:
            why = (str(error).strip().splitlines() or ["it cannot be imported"])[0]
            message = f"heba.{function.__qualname__} needs numpy: {why}; install numpy, or heba[numpy]"
            raise ImportError(message, name="numpy") from None
        return function(*args, **kwargs)

    return checked  # type: ignore[return-value]


__all__ = ["needs_numpy", "np"]
