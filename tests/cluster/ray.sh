#!/bin/sh
# A Ray head that asks for a token, and two worker nodes, all on the loopback of this machine.
#   tests/cluster/ray.sh start FOLDER [open]     "open": no token, no nodes, to see such a head refused
#   tests/cluster/ray.sh kill FOLDER node1       end a node at once, as a power cut would
#   tests/cluster/ray.sh stop FOLDER
# FOLDER keeps token, logs and process ids. Ray comes from PyPI into an environment of its own, FOLDER/venv
# or AIRLENS_RAY_VENV: airlens speaks REST to it and does not need it.
set -eu
action=$1 folder=$2
venv=${AIRLENS_RAY_VENV:-$folder/venv}
export RAY_JOB_STOP_WAIT_TIME_S=30 RAY_TMPDIR="$folder/tmp" RAY_USAGE_STATS_ENABLED=0

node() { # NAME ADDRESS OPTIONS...: a session of its own, so that the whole node can be killed
  name=$1 address=$2 && shift 2
  setsid "$venv/bin/ray" start --block --disable-usage-stats --node-ip-address="$address" \
    --object-store-memory=80000000 --num-gpus=0 "$@" >"$folder/$name.log" 2>&1 </dev/null &
  echo $! >"$folder/$name.pid"
}

await() {
  waiting=120
  until grep -q "Ray runtime started" "$folder/$1.log"; do
    waiting=$((waiting - 1))
    [ $waiting -gt 0 ] && kill -0 "$(cat "$folder/$1.pid")" || { cat "$folder/$1.log"; exit 1; }
    sleep 1
  done
}

start() {
  mkdir -p "$folder/tmp"
  if [ ! -x "$venv/bin/ray" ]; then
    python3 -m venv "$venv"
    "$venv/bin/python" -m pip install --quiet "ray[default]"
  fi
  if [ "${1:-}" = open ]; then
    export RAY_AUTH_MODE=disabled
  else
    [ -s "$folder/token" ] || (umask 077 && od -An -N32 -tx1 /dev/urandom | tr -d ' \n' >"$folder/token")
    export RAY_AUTH_MODE=token RAY_AUTH_TOKEN_PATH="$folder/token"
  fi
  # Loopback addresses other than 127.0.0.1, which Ray replaces by the machine's outward one.
  # The head has no processor for jobs, so that losing a node never loses the head.
  node head 127.0.0.2 --head --port=26379 --num-cpus=0 --memory=200000000 \
    --include-dashboard=true --dashboard-host=127.0.0.1 --dashboard-port=28265
  await head
  if [ "${1:-}" != open ]; then
    for n in 1 2; do
      node node$n 127.0.0.$((n + 2)) --address=127.0.0.2:26379 --num-cpus=1 --memory=4000000000
      await node$n
    done
  fi
}

end() { # SIGNAL NAME: the session of that node and nothing else
  [ -f "$folder/$2.pid" ] || return 0
  pkill "-$1" --session "$(cat "$folder/$2.pid")" || true
  [ "$1" = TERM ] || rm "$folder/$2.pid"
}

case $action in
start) start "${3:-}" ;;
kill) end KILL "$3" ;;
stop)
  for name in node2 node1 head; do end TERM $name; done
  sleep 5
  for name in node2 node1 head; do end KILL $name; done
  ;;
*) sed -n '2,7p' "$0" && exit 2 ;;
esac
