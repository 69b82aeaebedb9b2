"""Ctrl-C and SIGTERM: the analysis stops in equilibrium, with all results so far on disk.

The signal is only noted; the driver of the step asks at the next accepted increment or release, on
all ranks together, and raises :class:`Interrupted`. A thread ends the process when that takes
longer than some seconds (a long factorisation): what was written before is whole in any case.
"""

from __future__ import annotations

import os
import signal
import socket
import threading
from types import FrameType
from typing import Any

PATIENCE = 6.0
"""Seconds from the signal to the end at the latest."""


class Interrupted(KeyboardInterrupt):
    """The analysis was stopped by a signal, on all ranks together.

    Args:
        signum: Number of the signal.
        kept: What was saved and where, for the message.

    Attributes:
        code: Exit code of the process by convention, 128 + signum (130, 143).
    """

    def __init__(self, signum: int, kept: str) -> None:
        super().__init__(f"stopped by {signal.Signals(signum).name}; {kept}")
        self.code = 128 + signum


_NOBODYS = {
    # gmsh.initialize() puts SIG_DFL, which ends the process on the spot, in the place of Python's
    signal.SIGINT: (signal.default_int_handler, signal.SIG_DFL),
    signal.SIGTERM: (signal.SIG_DFL,),
}
"""Dispositions by which a signal ends the process: no program has asked for another answer."""


class Listener:
    """Context manager that notes SIGINT and SIGTERM instead of letting them end the process.

    It takes a signal whose disposition is the default of the system or that of Python, and puts
    that back at the end. A handler that a program has set remains in effect, and a
    signal that is ignored remains so. Outside the main thread it does nothing. A second signal
    ends the process at once.

    Args:
        patience: Seconds the program has to stop by itself.

    Attributes:
        signum: Number of the signal that came, 0 if none.
    """

    def __init__(self, patience: float = PATIENCE) -> None:
        self.signum = 0
        self._patience = patience
        self._before: dict[int, Any] = {}
        self._done = threading.Event()
        self._ends: tuple[socket.socket, socket.socket] | None = None
        self._fd_before = -1

    def __enter__(self) -> Listener:
        """Begin to listen."""
        if threading.current_thread() is not threading.main_thread():
            return self
        for number, dispositions in _NOBODYS.items():
            if signal.getsignal(number) in dispositions:
                self._before[number] = signal.signal(number, self._note)
        if self._before:
            self._ends = socket.socketpair()
            self._ends[1].setblocking(False)
            self._fd_before = signal.set_wakeup_fd(
                self._ends[1].fileno(), warn_on_full_buffer=False
            )
            threading.Thread(target=self._watch, args=(self._ends[0],), daemon=True).start()
        return self

    def __exit__(self, *error: object) -> None:
        """Restore the previous signal handlers."""
        self._done.set()
        for number, handler in self._before.items():
            signal.signal(number, handler)
        if self._ends is not None:
            signal.set_wakeup_fd(self._fd_before)
            self._ends[1].close()  # the thread sees the end of its input
        self._before, self._ends = {}, None

    def _note(self, signum: int, frame: FrameType | None) -> None:
        if self.signum:
            os._exit(128 + signum)
        self.signum = signum

    def _watch(self, end: socket.socket) -> None:
        """Runs in a thread: the numbers of signals arrive here even while C code works."""
        with end:
            while numbers := end.recv(16):
                found = [n for n in numbers if n in self._before]
                if found and not self._done.wait(self._patience):
                    text = (
                        f"fxcrack: stopped by {signal.Signals(found[0]).name} inside a computation "
                        f"of more than {self._patience:g} s; files hold what was written before\n"
                    )
                    os.write(2, text.encode())
                    os._exit(128 + found[0])
