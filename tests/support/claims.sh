# Sourced by the tests that run cells: $domain is a DDS domain (101 to 199; test programs in C++ take 1 to 100) and $port a TCP
# port, it and the nine behind it, that no other test holds as long as this one runs: a lock on a file each, which goes with it.
claim() {  # claim NAME FIRST STEP COUNT: sets the variable NAME
  local folder=${TMPDIR:-/tmp}/invar-test-claims-$UID value lock
  mkdir -p "$folder"
  for value in $(seq "$2" "$3" $(($2 + $3 * ($4 - 1))) | shuf); do
    exec {lock}>"$folder/$1-$value"
    if flock -n "$lock"; then printf -v "$1" %s "$value"; echo "$1 $value"; return; fi
    exec {lock}>&-
  done
  echo "all of the $4 $1s are held: see $folder"; return 1
}
claim domain 101 1 99
claim port 20000 10 1000
