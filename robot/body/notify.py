"""systemd's notification protocol (sd_notify(3)): ready, alive, stopping."""

from __future__ import annotations

import os
import socket


class Notifier:
    """Sends state lines to the socket that systemd names; does nothing when there is none."""

    def __init__(self, address: str | None = None) -> None:
        address = os.environ.get("NOTIFY_SOCKET", "") if address is None else address
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket = (
            socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
            if address
            else None
        )

    def send(self, state: str) -> None:
        """Send for example `READY=1` or `WATCHDOG=1`; a missing listener is not our problem."""
        if self._socket is not None:
            try:
                self._socket.sendto(state.encode(), self._address)
            except OSError:
                return

    def close(self) -> None:
        """Release the socket."""
        if self._socket is not None:
            self._socket.close()
