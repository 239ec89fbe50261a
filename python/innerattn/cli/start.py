"""Where the command `innerattn` starts: it is ready for Ctrl-C before anything slow is loaded."""

from __future__ import annotations

from innerattn.signals import handle_requests, interrupt, leave


def main() -> int:
    """Load and run the command; see `innerattn.cli.main.main`."""
    handle_requests(leave)
    from innerattn.cli.main import main as run

    handle_requests(interrupt)
    return run()
