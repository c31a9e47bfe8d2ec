#!/usr/bin/env bash
# Traffic of a secured cell, an operator's command in it, is captured and sent again, all of it: the command is not carried out twice,
# and nothing ends. The same with the cell started anew. Lifespan and numbers of samples refuse such a plain repetition in an unsecured
# cell, too; there a forger may change them. replayed.sh INVAR SOURCE_DIR
set -euo pipefail
source "$(dirname "$0")/../support/alone.sh"
alone "$@"
cat >cell.yaml <<'Y'
invar_cell: 1
name: guarded
domain: 9
profiles: profiles.yaml
shared_memory: false
security: {keys: keys}
processes:
  loop:
    realtime: {rate: 100}
    components:
      heater: {type: simulated_heater, map: heater.yaml, port: 1502}
      thermal: {type: thermal, setpoint: 30, modbus: {port: 1502, map: heater.yaml}}
  watch: {rate: 10, components: {supervisor: {type: supervisor}}}
Y
fail() { echo "$*"; tail -n 30 ./*.log; exit 1; }
setpoint() { "$invar" param "$1" cell.yaml thermal setpoint "${@:2}" --wait 20 >setpoint.log 2>&1 || fail "setpoint: $(cat setpoint.log)"; cat setpoint.log; }
well() { "$invar" status cell.yaml --wait 20 >status.log 2>&1 || fail "the cell is not well"; }
begin() { "$invar" run cell.yaml >run.log 2>&1 & pids=($!); well; }
end() { kill -INT "${pids[0]}"; wait "${pids[0]}" || fail "the cell did not end in order"; pids=(); }
cat >again.py <<'P'
import collections, socket, sys
out, counts = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), collections.Counter()
out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
for line in open(sys.argv[1]):
    address, port, payload = line.split()
    counts[address] += 1
    out.sendto(bytes.fromhex(payload), (address, int(port)))
print(dict(counts))
assert sum(counts.values()) > 500
P
again() { /usr/bin/python3 again.py sent.txt || fail "nothing was captured"; }
pids_of() { "$invar" status cell.yaml --json --wait 20 | grep '"pid"'; }

"$invar" keys cell.yaml >keys.log
begin
tshark -q -i lo -f udp -w sent.pcap >tshark.log 2>&1 & capture=$!
for _ in $(seq 100); do grep -q Capturing tshark.log && break; sleep 0.1; done
setpoint set 31 >/dev/null
sleep 1
kill -INT "$capture"; wait "$capture" || true
tshark -r sent.pcap -T fields -e ip.dst -e udp.dstport -e udp.payload -E separator=' ' 2>/dev/null | awk 'NF == 3' >sent.txt
setpoint set 35 >/dev/null
before=$(pids_of)
again
well
[[ $(setpoint get) == *35* ]] || fail "a command that was sent again was carried out: $(cat setpoint.log)"
[[ $(pids_of) == "$before" ]] || fail "a process ended"
end
begin
setpoint set 36 >/dev/null
again
well
[[ $(setpoint get) == *36* ]] || fail "a command of an earlier life was carried out: $(cat setpoint.log)"
end
echo passed
