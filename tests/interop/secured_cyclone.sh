#!/usr/bin/env bash
# A program of the plant on Cyclone DDS, with the plugins of Debian and the certificate that `invar keys` made for it, reads loop and
# status of a secured cell and commands it; the same program without certificate gets nothing.
# secured_cyclone.sh INVAR SOURCE_DIR CYCLONE_PEER
set -euo pipefail
source "$(dirname "$0")/../support/alone.sh"
alone "$@"
peer=$3
plugins=$(dirname "$(find /usr/lib -name libdds_security_auth.so | head -n 1)")
cp -r "$source"/deployment/* .
# The peer knows a cell `test` with an axis `axis`.
sed 's/^name: .*/name: test/; s/stage_x/axis/g; s/^domain: .*/domain: 77/; s/^time: .*/time: real/' xy-table.yaml >cell.yaml
cat >>cell.yaml <<'Y'
security:
  plant:
    mes: {reads: [axis.state, /cell/test/heat/node, /cell/test/process/components], writes: [axis.command]}
Y
fail() { echo "$*"; tail -n 20 ./*.log; exit 1; }
until_says() { for _ in $(seq 200); do grep -qE "$1" "$2" && return; sleep 0.1; done; fail "$2 never says: $1"; }
"$invar" keys cell.yaml >keys.log
cat >open.xml <<X
<CycloneDDS><Domain id="any"><General><Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces></General></Domain></CycloneDDS>
X
library() { echo "<Library path=\"$plugins/libdds_security_$1.so\" initFunction=\"init_$2\" finalizeFunction=\"finalize_$2\"/>"; }
sed "s#</Domain>#<Security><Authentication>$(library auth authentication)<IdentityCA>file:$folder/keys/public/identity_ca.pem</IdentityCA>\
<IdentityCertificate>file:$folder/keys/mes/certificate.pem</IdentityCertificate><PrivateKey>file:$folder/keys/mes/key.pem</PrivateKey>\
<CRL>file:$folder/keys/public/revoked.pem</CRL></Authentication><Cryptographic>$(library crypto crypto)</Cryptographic>\
<AccessControl>$(library ac access_control)<PermissionsCA>file:$folder/keys/public/permissions_ca.pem</PermissionsCA>\
<Governance>file:$folder/keys/public/governance.p7s</Governance><Permissions>file:$folder/keys/mes/permissions.p7s</Permissions>\
</AccessControl></Security></Domain>#" open.xml >secured.xml

"$invar" run cell.yaml >run.log 2>&1 & run=$!; pids+=("$run")
"$invar" status cell.yaml --wait 20 >status.log || fail "the cell is not well"
CYCLONEDDS_URI=file://$folder/open.xml stdbuf -oL "$peer" 77 5 >stranger.log 2>&1 & pids+=($!); stranger=$!
CYCLONEDDS_URI=file://$folder/secured.xml stdbuf -oL "$peer" 77 5 >member.log 2>&1 & pids+=($!)
until_says '^state 0 ' member.log
for component in axis thermal supervisor; do until_says "^component $component 2 " member.log; done
# It commands an axis that the cell does not have, which the axis that there is says.
until_says 'axis/command. was not obeyed: its key is cell 0, axis 3' run.log
wait "$stranger" || fail "the program without certificate failed"
grep -qx 'end 0 0 0 0' stranger.log || fail "a program without certificate got samples"
kill -INT "$run"; wait "$run" || fail "the cell did not end in order"
pids=("${pids[@]:1}")
echo passed
