#!/bin/sh
# Installs the gateway's Debian package in a throw-away copy of this system's root, without a network, and runs its
# commands as the service's own user: `sudo sh systemd/try-deb.sh dist/igrow-edge_*.deb`. Nothing of this system changes.
set -eu

PACKAGE=$1
WORK=$(mktemp -d)
if [ "${2:-}" != inside ]; then
    # A mount namespace and a network of its own: what is mounted goes with the process.
    unshare --mount --net sh "$0" "$PACKAGE" inside "$WORK" && status=0 || status=$?
    rm -rf "$WORK"
    exit $status
fi

WORK=$3
mount -t tmpfs tmpfs "$WORK"
mkdir "$WORK/upper" "$WORK/work" "$WORK/root"
mount -t overlay overlay -o "lowerdir=/,upperdir=$WORK/upper,workdir=$WORK/work" "$WORK/root"
mount -t proc proc "$WORK/root/proc"
mount --bind /dev "$WORK/root/dev"
rm -rf "$WORK/root/opt/igrow" "$WORK/root/etc/igrow"
cp "$PACKAGE" "$WORK/root/tmp/igrow-edge.deb"

inside() { chroot "$WORK/root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root DEBIAN_FRONTEND=noninteractive \
    sh -euc "$1"; }
as_service() { inside "cd /tmp && setpriv --reuid=igrow --regid=igrow --init-groups $1"; }

inside 'dpkg --install --force-depends /tmp/igrow-edge.deb'
as_service 'igrow-edge --version'
as_service 'igrow-edge check-config /etc/igrow/daemon.yaml'
inside 'ls -ld /etc/igrow /srv/igrow-exchange; du -sh /opt/igrow/venv | cut -f1'
echo "# of the grower" >>"$WORK/root/etc/igrow/site.yaml"
inside 'dpkg --install --force-depends /tmp/igrow-edge.deb >/dev/null; tail -1 /etc/igrow/site.yaml | grep -q grower'
as_service 'igrow-edge --version'
inside 'dpkg --purge igrow-edge >/dev/null; ! test -e /opt/igrow && ! test -e /etc/igrow'
echo "the package installs, updates and goes in a clean root"
