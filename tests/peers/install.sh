#!/bin/sh
# Installs the peers that tests talk to: mbpoll, socat, libmodbus' own test server, mosquitto,
# systemd-analyze, and two Node packages. Needs root (or sudo) for the Debian packages.
set -eu
cd "$(dirname "$0")"

as_root=""
[ "$(id -u)" = 0 ] || as_root=sudo
missing=""
for package in mbpoll socat libmodbus-dev mosquitto gcc pkg-config; do
    dpkg -s "$package" >/dev/null 2>&1 || missing="$missing $package"
done
command -v node >/dev/null 2>&1 || missing="$missing nodejs"
command -v systemd-analyze >/dev/null 2>&1 || missing="$missing systemd"
command -v npm >/dev/null 2>&1 || missing="$missing npm"
if [ -n "$missing" ]; then
    $as_root apt-get update -qq
    # shellcheck disable=SC2086 - a list of names
    $as_root apt-get install -y -qq --no-install-recommends $missing
fi

npm install --no-package-lock --no-audit --no-fund --silent

# libmodbus' example server has its port and its serial port written into it: take them from the command line.
mkdir -p build
examples=/usr/share/doc/libmodbus-dev/examples
source=$examples/unit-test-server.c
if [ -f "$source.gz" ]; then gunzip -c "$source.gz"; else cat "$source"; fi |
    sed -e 's/"127.0.0.1", 1502/"127.0.0.1", atoi(argv[2])/' \
        -e 's|"/dev/ttyUSB0", 115200|argv[2], 19200|' >build/unit-test-server.c
cp "$examples/unit-test.h" build/
# shellcheck disable=SC2046 - flags
gcc -o build/unit-test-server build/unit-test-server.c $(pkg-config --cflags --libs libmodbus)
echo "Modbus peers are installed."
