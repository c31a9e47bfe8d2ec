#!/usr/bin/env bash
# Puts promtool of Debian's package `prometheus` into FOLDER. The package itself would start a server that listens on every network of the
# PC, so it is unpacked and not installed. promtool.sh FOLDER
set -euo pipefail
folder=$1
mkdir -p "$folder"
[[ -x $folder/promtool ]] && exit 0
cd "$folder"
apt-get download prometheus
dpkg-deb --fsys-tarfile prometheus_*.deb | tar -xO ./usr/bin/promtool >promtool.new
rm prometheus_*.deb
chmod +x promtool.new
mv promtool.new promtool
