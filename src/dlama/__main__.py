"""The door: `dlama`, which is `python -m dlama`. Ctrl-C while the program is being loaded ends it with one line, too."""

import gc
import os
import signal
from types import FrameType

from dlama.apps.loading import loading


def end(number: int, frame: FrameType | None) -> None:
    """Ends the process with a line; of what is not yet loaded nothing has been written."""
    os.write(2, b"error: interrupted; nothing half-written is left\n")
    os._exit(130)


def main() -> None:
    """The command line; it takes signals over when it begins to work."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not where the shell has it ignored
        signal.signal(signal.SIGINT, end)
    with loading():
        from dlama.apps.cli import main as run
    try:
        run()
    finally:
        gc.freeze()  # what is left need not be searched for garbage: a fifth of a second


if __name__ == "__main__":
    main()
