"""`python -m dlama` is `dlama`."""

from dlama.apps.cli import main

main()
