#!/bin/sh
# From a fresh Raspberry Pi OS (trixie; bookworm works too) to an installed robot. Safe to run
# again: every step is idempotent, and the configuration in /etc/sweeper is never overwritten.
# usage: sudo deploy/install.sh [--update] [--root DIR]
#   --update    into the second slot, with automatic rollback   --root DIR  into a folder (images)
set -eu

verb=install
root=
while [ $# -gt 0 ]; do
    case $1 in
        --update) verb=update ;;
        --root) root=${2:?"--root needs a directory"}; shift ;;
        *) echo "install.sh: unknown option $1; usage: install.sh [--update] [--root DIR]" >&2
           exit 2 ;;
    esac
    shift
done
source=$(cd "$(dirname "$0")/.." && pwd)
if [ -n "$root" ]; then
    exec "${PYTHON:-python3}" "$source/deploy/manage.py" "$verb" "$source" --root "$root"
fi
if [ "$(id -u)" != 0 ]; then
    echo "install.sh: must run as root (or give --root DIR); try: sudo deploy/install.sh" >&2
    exit 2
fi
if [ "$verb" = install ] && command -v apt-get >/dev/null; then
    export DEBIAN_FRONTEND=noninteractive
    apt-get update -qq
    # libcamera's Python module comes from Debian, never from pip; bookworm has it in backports.
    apt-get install -y -qq --no-install-recommends \
        python3 python3-venv i2c-tools v4l-utils avrdude gcc-avr avr-libc make
    apt-get install -y -qq --no-install-recommends python3-libcamera libcamera-ipa ||
        echo "install.sh: no python3-libcamera here; USB cameras work without it" >&2
fi
"${PYTHON:-python3}" "$source/deploy/manage.py" "$verb" "$source"
echo "Next: /opt/sweeper/current/bin/sweeper check --config /etc/sweeper/robot.toml"
