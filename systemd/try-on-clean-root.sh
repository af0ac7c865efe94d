#!/bin/sh
# Follows docs/installation.md on a clean Debian 12 root in a chroot, and runs the installed daemon there against
# a simulated PLC as the service's own user: `sudo sh systemd/try-on-clean-root.sh FOLDER`.
# Needs debootstrap. CERTIFICATES may name a bundle of certificate authorities for networks with their own.
set -eu

ROOT=$1
SOURCE=$(cd "$(dirname "$0")/.." && pwd)

if [ ! -x "$ROOT/usr/bin/apt-get" ]; then
    debootstrap --variant=minbase --include=ca-certificates bookworm "$ROOT"
fi
cp /etc/resolv.conf "$ROOT/etc/resolv.conf"
[ -z "${CERTIFICATES:-}" ] || cp "$CERTIFICATES" "$ROOT/etc/ssl/certs/ca-certificates.crt"
rm -rf "$ROOT/usr/src/igrow"
mkdir -p "$ROOT/usr/src/igrow"
(cd "$SOURCE" && git archive HEAD) | tar -x -C "$ROOT/usr/src/igrow"
mountpoint -q "$ROOT/proc" || mount -t proc proc "$ROOT/proc"
trap 'umount "$ROOT/proc"' EXIT

inside() { chroot "$ROOT" env -i PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/root \
    DEBIAN_FRONTEND=noninteractive PIP_ROOT_USER_ACTION=ignore sh -euc "$1"; }

inside 'apt-get update -qq; apt-get install -qq -y --no-install-recommends python3-venv systemd >/dev/null'
inside 'sh /usr/src/igrow/systemd/install.sh'
inside 'igrow-edge check-config /etc/igrow/daemon.yaml'
inside 'du -sh /opt/igrow/venv | cut -f1; id igrow; ls -ld /etc/igrow /srv/igrow-exchange'
inside 'for unit in igrow-edge igrow-page; do
    systemd-analyze security --offline=true --no-pager /etc/systemd/system/$unit.service | tail -1; done'
inside '
    mkdir -p /tmp/try && chown igrow /tmp/try && cd /tmp/try
    sed "s|^state:.*|state: /tmp/try/state|; s|^exchange:.*|exchange: /srv/igrow-exchange|" /etc/igrow/daemon.yaml \
        > daemon.yaml
    sed -i "s|^site:.*|site: /etc/igrow/site.yaml|; s|^register_map:.*|register_map: /etc/igrow/register-maps/virtual-plc.yaml|" daemon.yaml
    igrow-edge simulate-plc --map /etc/igrow/register-maps/virtual-plc.yaml --days 2 >plc.log 2>&1 &
    plc=$!
    sleep 8
    status=0
    setpriv --reuid=igrow --regid=igrow --init-groups timeout --preserve-status -s TERM 40 \
        igrow-edge run daemon.yaml >run.log 2>&1 &
    sleep 14
    daemon=$!
    igrow-edge status daemon.yaml || status=$?
    setpriv --reuid=igrow --regid=igrow --init-groups timeout --preserve-status -s TERM 10 \
        igrow-edge page daemon.yaml >page.log 2>&1 &
    sleep 6
    /opt/igrow/venv/bin/python -c "
from urllib.request import urlopen
assert b\"recipe decides\" in urlopen(\"http://127.0.0.1:8421/\").read()
print(\"the page answers\")" || { cat page.log; status=1; }
    wait $daemon || true
    kill $plc
    cat run.log
    exit $status
'
echo "the installation works on a clean root"
