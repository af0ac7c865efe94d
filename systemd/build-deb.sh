#!/bin/sh
# Builds the gateway's Debian package into a folder: `sh systemd/build-deb.sh dist`.
# The package holds wheels of igrow and of all that the gateway uses, and makes its virtual environment of them when it is
# installed, without any network. Needs dpkg-deb, python3-venv of the Debian release that it is for, and a package index.
set -eu

SOURCE=$(cd "$(dirname "$0")/.." && pwd)
OUT=$(mkdir -p "$1" && cd "$1" && pwd)
PYTHON=${PYTHON:-python3}
WORK=$(mktemp -d)
trap 'rm -rf "$WORK"' EXIT
TREE=$WORK/tree

command -v dpkg-deb >/dev/null || { echo "error: dpkg-deb is not here: the package is built on Debian" >&2; exit 2; }

mkdir -p "$TREE/DEBIAN" "$TREE/opt/igrow/wheels" "$TREE/opt/igrow/docs" "$TREE/opt/igrow/config" \
    "$TREE/lib/systemd/system" "$TREE/usr/lib/sysusers.d" "$TREE/usr/lib/tmpfiles.d" "$TREE/usr/bin"
# Of a build before this one nothing may get into the package.
rm -rf "$SOURCE/build"
"$PYTHON" -m venv "$WORK/venv"
"$WORK/venv/bin/pip" wheel --quiet --disable-pip-version-check --wheel-dir "$TREE/opt/igrow/wheels" "$SOURCE[edge]"
rm -rf "$SOURCE/build"
version=$(basename "$TREE"/opt/igrow/wheels/igrow-*.whl | cut -d- -f2)
# To Debian a development version comes before the release that it leads to.
version=$(echo "$version" | sed 's/\.dev/~dev/')
running=$("$PYTHON" -c 'import sys; print("python3 (>= %d.%d), python3 (<< %d.%d), python3-venv" % (*sys.version_info[:2], sys.version_info[0], sys.version_info[1] + 1))')
cp "$SOURCE"/docs/*.md "$TREE/opt/igrow/docs/"
cp -r "$SOURCE/config/daemon.yaml" "$SOURCE/config/site.yaml" "$SOURCE/config/register-maps" "$TREE/opt/igrow/config/"
cp "$SOURCE"/systemd/*.service "$TREE/lib/systemd/system/"
cp "$SOURCE/systemd/igrow-edge.sysusers.conf" "$TREE/usr/lib/sysusers.d/igrow-edge.conf"
cp "$SOURCE/systemd/igrow-edge.tmpfiles.conf" "$TREE/usr/lib/tmpfiles.d/igrow-edge.conf"
ln -s /opt/igrow/venv/bin/igrow-edge "$TREE/usr/bin/igrow-edge"
for script in postinst prerm postrm; do
    install -m 755 "$SOURCE/systemd/debian/$script" "$TREE/DEBIAN/$script"
done
chmod -R go+rX,go-w "$TREE"
cat >"$TREE/DEBIAN/control" <<END
Package: igrow-edge
Version: $version
Architecture: $(dpkg --print-architecture)
Maintainer: igrow <noreply@invalid>
Depends: $running, systemd
Section: science
Priority: optional
Installed-Size: $(du -ks "$TREE" | cut -f1)
Description: greenhouse controller between a PLC on Modbus and its plans
 Reads the greenhouse, plans with an ONNX simulator of it, and writes setpoints through a guard that has the last word.
END
dpkg-deb --root-owner-group -Zxz -z1 --build "$TREE" "$OUT/igrow-edge_${version}_$(dpkg --print-architecture).deb" >/dev/null
ls -l "$OUT"/igrow-edge_*.deb
