#!/bin/sh
# A SLURM of two nodes on the loopback of this machine, from Debian's packages.
#   apt-get install -y --no-install-recommends slurmctld slurmd slurm-client munge     (once, as root)
#   tests/cluster/slurm.sh start FOLDER
#   tests/cluster/slurm.sh kill FOLDER node1     end a node's daemon at once
#   tests/cluster/slurm.sh stop FOLDER
# FOLDER keeps configuration, key, state, logs and process ids; SLURM_CONF=FOLDER/slurm.conf for clients.
set -eu
action=$1 folder=$2
export SLURM_CONF="$folder/slurm.conf"

configure() {
  mkdir -p "$folder/state" "$folder/node1" "$folder/node2"
  chmod 755 "$folder"
  (umask 077 && head -c 1024 /dev/urandom >"$folder/munge.key")
  cat >"$SLURM_CONF" <<CONF
ClusterName=airlens
SlurmctldHost=localhost(127.0.0.1)
SlurmctldPort=26817
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$folder/munge.socket
CryptoType=crypto/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/%n
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/%n.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SlurmdTimeout=15
KillWait=10
MinJobAge=60
ReturnToService=2
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
MpiDefault=none
NodeName=node1 NodeHostname=localhost NodeAddr=127.0.0.1 Port=26821 CPUs=1 RealMemory=4000
NodeName=node2 NodeHostname=localhost NodeAddr=127.0.0.1 Port=26822 CPUs=1 RealMemory=4000
PartitionName=all Nodes=node1,node2 Default=YES MaxTime=INFINITE State=UP
CONF
}

start() {
  configure
  munged --force --key-file="$folder/munge.key" --socket="$folder/munge.socket" --pid-file="$folder/munged.pid" \
    --log-file="$folder/munged.log" --seed-file="$folder/munge.seed"
  slurmctld -c
  for name in node1 node2; do slurmd -N $name; done
  waiting=60
  until [ "$(sinfo --noheader --format=%T | sort -u)" = idle ]; do
    waiting=$((waiting - 1))
    [ $waiting -gt 0 ] || { sinfo; tail -n 20 "$folder"/*.log; exit 1; }
    sleep 1
  done
}

end() { # SIGNAL NAME: the process whose number is in NAME.pid and nothing else
  [ -f "$folder/$2.pid" ] || return 0
  kill "-$1" "$(cat "$folder/$2.pid")" 2>/dev/null || true
}

case $action in
start) start ;;
kill) end KILL "$3" ;;
stop)
  scancel --user="$(id -un)" 2>/dev/null || true
  sleep 2
  for name in node1 node2 slurmctld munged; do end TERM $name; done
  ;;
*) sed -n '2,7p' "$0" && exit 2 ;;
esac
