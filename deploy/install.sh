#!/bin/sh
# Installs Sweeper from this checkout as a systemd service. Safe to run again: every step is
# idempotent, and the configuration in /etc/sweeper is never overwritten.
# usage: sudo deploy/install.sh [--root DIR]     DIR is prepended to every path (for images and tests)
set -eu

root=""
if [ "${1:-}" = "--root" ]; then
    root=${2:?"--root needs a directory"}
elif [ $# -gt 0 ]; then
    echo "install.sh: unknown option $1; usage: install.sh [--root DIR]" >&2
    exit 2
elif [ "$(id -u)" != 0 ]; then
    echo "install.sh: must run as root (or give --root DIR); try: sudo deploy/install.sh" >&2
    exit 2
fi

source=$(cd "$(dirname "$0")/.." && pwd)
python=${PYTHON:-python3}
version=$("$python" - "$source/pyproject.toml" <<'PY'
import sys, tomllib
print(tomllib.load(open(sys.argv[1], "rb"))["project"]["version"])
PY
)
home=$root/opt/sweeper
release=$home/releases/$version

mkdir -p "$home/releases" "$root/etc/sweeper" "$root/etc/systemd/system" "$root/etc/udev/rules.d"
if [ ! -e "$release/.complete" ]; then
    rm -rf "$release"
    # libcamera's Python module comes from Debian, never from pip.
    "$python" -m venv --system-site-packages "$release"
    "$release/bin/pip" install --quiet ${PIP_OPTIONS:-} "$source"
    sed -i "1s|^#!$root|#!|" "$release/bin/sweeper"
    touch "$release/.complete"
fi
ln -sfn "releases/$version" "$home/current"

install -m 0644 "$source/systemd/sweeper.service" "$root/etc/systemd/system/sweeper.service"
install -m 0644 "$source/deploy/udev/99-sweeper.rules" "$root/etc/udev/rules.d/99-sweeper.rules"
[ -e "$root/etc/sweeper/robot.toml" ] ||
    install -m 0644 "$source/deploy/config/robot.toml" "$root/etc/sweeper/robot.toml"

if [ -z "$root" ]; then
    udevadm control --reload
    udevadm trigger --subsystem-match=tty
    systemctl daemon-reload
    systemctl enable --now sweeper.service
    echo "Installed $version. Next: sweeper check --config /etc/sweeper/robot.toml"
fi
