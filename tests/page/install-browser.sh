#!/bin/sh
# Installs the browser that the tests of the page use: Debian's Chromium, and a font. Needs root (or sudo).
set -eu
command -v chromium >/dev/null 2>&1 && exit 0
as_root=""
[ "$(id -u)" = 0 ] || as_root=sudo
$as_root apt-get update -qq
$as_root apt-get install -y -qq --no-install-recommends chromium fonts-dejavu-core
