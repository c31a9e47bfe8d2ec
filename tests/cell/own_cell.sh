# Sourced by the tests that run a shipped cell: own_cell NAME SOURCE PORT copies deployment/ into $folder, which goes at the end,
# and gives deployment/NAME.yaml a domain and, in place of PORT, a Modbus port of its own.
source "$(dirname "${BASH_SOURCE[0]}")/../support/claims.sh"
own_cell() {
  folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
  cp -r "$2/deployment" "$folder/deployment"
  sed -i "s/^domain: .*/domain: $domain/; s/$3/$port/g" "$folder/deployment/$1.yaml"
}

# rms FILE: RMS of (displacement - way) [um], straight from a file of displacement lines.
rms() {
  awk -F, 'NR > 1 { if ($1 != name) { name = $1; x = $2; y = $3 }
    e = $5 - sqrt(($2 - x)^2 + ($3 - y)^2); sum += e * e; n++ } END { printf "%.4f\n", 1e6 * sqrt(sum / n) }' "$1"
}
