#!/bin/sh
# Installs the gateway on Debian 12 or later, from a source folder: `sudo sh systemd/install.sh`.
# EXTRAS=edge,notify,mqtt adds what the services beside the daemon use.
# May be run again for an update: configuration and log are left alone. Explained in docs/installation.md.
set -eu

SOURCE=$(cd "$(dirname "$0")/.." && pwd)
TARGET=/opt/igrow
PYTHON=${PYTHON:-python3}

"$PYTHON" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
    echo "error: $PYTHON is older than 3.11; Debian 12 or later has it" >&2
    exit 2
}

# Debian keeps the modules for virtual environments in a package of their own.
"$PYTHON" -c 'import ensurepip' 2>/dev/null || {
    echo "0. python3-venv"
    apt-get install -y -qq --no-install-recommends python3-venv
}

echo "1. program into $TARGET/venv"
mkdir -p "$TARGET/docs"
[ -x "$TARGET/venv/bin/python" ] || "$PYTHON" -m venv "$TARGET/venv"
"$TARGET/venv/bin/pip" install --quiet --no-compile --upgrade "$SOURCE[${EXTRAS:-edge}]"
# Compiled once here: the daemon may not write there.
"$TARGET/venv/bin/python" -m compileall -q "$TARGET/venv/lib" || true
cp "$SOURCE"/docs/*.md "$TARGET/docs/"
ln -sf "$TARGET/venv/bin/igrow-edge" /usr/local/bin/igrow-edge

echo "2. user, folders, service"
install -m 644 "$SOURCE/systemd/igrow-edge.sysusers.conf" /usr/lib/sysusers.d/igrow-edge.conf
install -m 644 "$SOURCE/systemd/igrow-edge.tmpfiles.conf" /usr/lib/tmpfiles.d/igrow-edge.conf
for unit in igrow-edge.service igrow-page.service igrow-notify.service igrow-mqtt.service \
    igrow-forecast.service igrow-forecast.timer; do
    install -m 644 "$SOURCE/systemd/$unit" "/etc/systemd/system/$unit"
done
systemd-sysusers igrow-edge.conf
systemd-tmpfiles --create igrow-edge.conf

echo "3. configuration into /etc/igrow (what is there stays)"
for file in "$SOURCE"/config/daemon.yaml "$SOURCE"/config/site.yaml "$SOURCE"/config/register-maps/*.yaml; do
    [ -f "$file" ] || continue
    goal="/etc/igrow/${file#"$SOURCE"/config/}"
    [ -e "$goal" ] && continue
    mkdir -p "$(dirname "$goal")"
    install -m 640 -o root -g igrow "$file" "$goal"
done
chgrp -R igrow /etc/igrow
chmod -R g+rX /etc/igrow

[ ! -d /run/systemd/system ] || systemctl daemon-reload || true
echo "done. Next: edit /etc/igrow, then"
echo "  sudo -u igrow igrow-edge commission"
echo "  systemctl enable --now igrow-edge igrow-page"
