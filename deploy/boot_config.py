"""Our lines in the board's /boot/firmware/config.txt: there once, or gone without a trace."""

from __future__ import annotations

from pathlib import Path

from slots import write_whole

CONFIG_TXT = """\
dtparam=i2c_arm=on,i2c_arm_baudrate=400000
camera_auto_detect=1
# Start button between GPIO 17 and ground; buzzer (through a transistor) on GPIO 18.
dtoverlay=gpio-key,gpio=17,active_low=1,gpio_pull=up,keycode=148,label=sweeper-start
dtoverlay=gpio-led,gpio=18,label=buzzer
# The firmware's own watchdog restarts a board that hangs (at most 15 s).
dtparam=watchdog=on
"""
BEGIN, END = "# sweeper: begin", "# sweeper: end"


def enter(root: Path) -> None:
    """Add our lines; a board without the file (an image's folder, a PC) is left alone."""
    _change(root, added=f"{BEGIN}\n[all]\n{CONFIG_TXT}{END}\n")  # [all]: valid for every board


def leave(root: Path) -> None:
    """Take our lines away."""
    _change(root, added="")


def _change(root: Path, added: str) -> None:
    path = root / "boot/firmware/config.txt"
    if path.is_file():
        old = path.read_text(encoding="utf-8")
        new = without_block(old) + added
        if new != old:
            write_whole(path, new.encode(), 0o755)


def without_block(text: str) -> str:
    """config.txt without our lines."""
    kept, inside = [], False
    for line in text.splitlines():
        inside = inside or line.strip() == BEGIN
        if not inside:
            kept.append(line)
        inside = inside and line.strip() != END
    return "\n".join(kept).rstrip("\n") + "\n"
