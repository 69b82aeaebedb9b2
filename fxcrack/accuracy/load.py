"""From what the user names on the command line to a study."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from fxcrack.accuracy.scenes import known
from fxcrack.accuracy.study import Study
from fxcrack.base.errors import FxcrackError, InputError


def load(name: str) -> Study:
    """The study of a name.

    Args:
        name: A study that comes with fxcrack, or "path/to/file.py:function", or
            "package.module:function"; the function is a :class:`Study` or a scene function.

    Raises:
        InputError: There is no such thing; the message says what there is.
    """
    where, colon, function = name.rpartition(":")
    if not colon:
        return known(name)
    found = getattr(_module(where), function, None)
    if isinstance(found, Study):
        return found
    if not callable(found):
        raise InputError(
            f"'{where}' has no function '{function}'; name one that takes a Setting and returns a "
            "Case (see fxcrack.accuracy)"
        )
    return Study(found, title=function)


def _module(where: str) -> ModuleType:
    """Import a file or a module; a file's folder is searched for what it imports."""
    try:
        if not where.endswith(".py"):
            return importlib.import_module(where)
        path = Path(where).resolve()
        if not path.is_file():
            raise InputError(f"there is no file '{where}'")
        spec = importlib.util.spec_from_file_location(path.stem, path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        if str(path.parent) not in sys.path:
            # at the end: a file there that is called as a module of Python must not take its place
            sys.path.append(str(path.parent))
        sys.modules.setdefault(path.stem, module)
        spec.loader.exec_module(module)
    except FxcrackError:
        raise
    except Exception as error:  # whatever the user's file does wrong is said in one line
        raise InputError(
            f"'{where}' cannot be imported: {type(error).__name__}: {error}"
        ) from error
    return module
