#!/bin/sh
# Installs the servers that the exchange's tests talk to: OpenSSH's sshd (SFTP), PostgreSQL and InfluxDB. moto's S3 server
# comes with `igrow[dev]`. Needs root (or sudo). No service is left running: each test starts its own, on loopback.
set -eu
as_root=""
[ "$(id -u)" = 0 ] || as_root=sudo
missing=""
for package in openssh-server openssh-client postgresql influxdb; do
    dpkg -s "$package" >/dev/null 2>&1 || missing="$missing $package"
done
if [ -n "$missing" ]; then
    $as_root apt-get update -qq
    # shellcheck disable=SC2086 - a list of names
    DEBIAN_FRONTEND=noninteractive $as_root apt-get install -y -qq --no-install-recommends $missing
fi
echo "The exchange's peers are installed."
