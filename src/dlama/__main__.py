"""`python -m dlama` is `dlama`."""

import sys

try:
    from dlama.apps.cli import main
except KeyboardInterrupt:  # while it is being loaded
    print("error: interrupted; nothing half-written is left", file=sys.stderr)
    raise SystemExit(130) from None

main()
