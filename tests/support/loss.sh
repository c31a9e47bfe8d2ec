# Sourced by tests of lossy cables. loss INTERFACE PERMILLE: rules for nft, under which so many of a thousand UDP packets that come in by
# the interface are lost, each by itself. The table is `inet loss`.
loss() { echo "table inet loss { chain in { type filter hook input priority 0; iifname \"$1\" udp dport 1024-65535 numgen random mod 1000 < $2 counter drop; }; }"; }
