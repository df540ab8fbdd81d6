#!/usr/bin/env bash
# Runs a command with a docker daemon of its own: in network, mount and process namespaces of its own, behind user-mode NAT.
# Nothing outside is changed; when this script ends, or is killed, the daemon and all of its containers end with it.
#
#   tests/compose/with_docker.sh COMMAND...
#
# Needs root on Debian and its packages; what it installs and downloads is kept in $LALLIANCE_CACHE. The command finds
#   DOCKER_HOST   the daemon
#   BASE_IMAGE    a stand-in for python:3.12-slim, made of Debian's packages: no registry of images is asked
#   BUILD_CA      certificates that the build may need to reach a package index
#   DAEMON_PID    a process inside the daemon's namespaces, for nsenter
set -euo pipefail

CACHE=${LALLIANCE_CACHE:-/var/tmp/lalliance-compose}
PACKAGES=(docker.io runc containerd tini iptables iproute2 slirp4netns mmdebstrap)
SUITE=bookworm       # of the stand-in for the base image
PLUGIN_SUITE=trixie  # the first with compose v2 and buildx

say() { printf '%s: %s\n' "$(date +%T)" "$*" >&2; }

is_installed() { dpkg-query -W -f '${db:Status-Status}' "$1" 2>/dev/null | grep -qx installed; }

install_packages() {
    local missing=()
    for package in "${PACKAGES[@]}"; do is_installed "$package" || missing+=("$package"); done
    [ ${#missing[@]} -gt 0 ] || return 0
    say "installing ${missing[*]}"
    apt-get -q -o DPkg::Lock::Timeout=300 update
    # What is already there, such as a docker client, stays as it is; and no service is started.
    printf '#!/bin/sh\nexit 101\n' >"$CACHE/policy-rc.d"; chmod +x "$CACHE/policy-rc.d"
    local policy=/usr/sbin/policy-rc.d made=
    [ -e $policy ] || { cp "$CACHE/policy-rc.d" $policy; made=yes; }
    DEBIAN_FRONTEND=noninteractive apt-get -q -y -o DPkg::Lock::Timeout=300 install --no-install-recommends "${missing[@]}" ||
        { [ -z "$made" ] || rm $policy; return 1; }
    [ -z "$made" ] || rm $policy
}

mirror() {
    apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' | grep -v -e security -e backports | head -n 1
}

unpack_plugins() {
    local plugins=$CACHE/docker/cli-plugins
    [ ! -x "$plugins/docker-compose" ] || [ ! -x "$plugins/docker-buildx" ] || return 0
    say "unpacking compose and buildx"
    local apt=$CACHE/apt
    rm -rf "$apt"; mkdir -p "$plugins" "$apt"/{lists/partial,cache/archives/partial,unpacked}; chmod 755 "$apt"
    echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] $(mirror) $PLUGIN_SUITE main" >"$apt/sources.list"
    local options=(-q -o Dir::Etc::sourcelist="$apt/sources.list" -o Dir::Etc::sourceparts=/dev/null
        -o Dir::State::lists="$apt/lists" -o Dir::Cache="$apt/cache" -o APT::Sandbox::User=root)
    apt-get "${options[@]}" update
    (cd "$apt" && apt-get "${options[@]}" download docker-compose docker-buildx)
    for package in "$apt"/*.deb; do dpkg-deb -x "$package" "$apt/unpacked"; done
    cp "$apt"/unpacked/usr/libexec/docker/cli-plugins/docker-{compose,buildx} "$plugins/"
    rm -rf "$apt"
}

make_base() {
    [ ! -s "$CACHE/base.tar" ] || return 0
    say "making the base image"
    mmdebstrap -q --format=tar --variant=minbase --include=python3,python3-venv,ca-certificates \
        --aptopt='Acquire::Languages "none"' --dpkgopt='path-exclude=/usr/share/doc/*' \
        --dpkgopt='path-exclude=/usr/share/locale/*' --dpkgopt='path-exclude=/usr/share/man/*' \
        "$SUITE" "$CACHE/base.tar.new" "$(mirror)"
    mv "$CACHE/base.tar.new" "$CACHE/base.tar"
}

mkdir -p "$CACHE"
exec 9>"$CACHE/lock"; flock 9
if ! { install_packages && unpack_plugins && make_base; } >"$CACHE/log" 2>&1 9>&-; then
    tail -n 30 "$CACHE/log" >&2; say "the packages could not be had; all of it: $CACHE/log"; exit 1
fi

# What a run that was killed has left: folders and control groups; its processes died with it.
forget() {
    for group in /sys/fs/cgroup/*/"$1" /sys/fs/cgroup/"$1"; do
        [ ! -d "$group" ] || find "$group" -depth -type d -exec rmdir {} \; 2>/dev/null || true
    done
    rm -rf "/var/tmp/$1"
}
for folder in /var/tmp/lalliance-docker.??????; do
    if [ -f "$folder/owner" ] && [ ! -d "/proc/$(cat "$folder/owner")" ]; then forget "${folder##*/}"; fi
done
flock -u 9

HOME_OF_RUN=$(mktemp -d /var/tmp/lalliance-docker.XXXXXX); NAME=${HOME_OF_RUN##*/}
echo $$ >"$HOME_OF_RUN/owner"
DAEMON_PID=; NAT=; COMMAND=
end() {
    set +e
    [ -z "$COMMAND" ] || kill "$COMMAND" 2>/dev/null
    [ -z "$DAEMON_PID" ] || kill -9 "$DAEMON_PID" 2>/dev/null
    [ -z "$NAT" ] || kill "$NAT" 2>/dev/null
    for _ in $(seq 200); do [ -n "$DAEMON_PID" ] && [ -d "/proc/$DAEMON_PID" ] || break; sleep 0.05; done
    forget "$NAME"
    if [ -d "/proc/${DAEMON_PID:-none}" ] || [ -e "$HOME_OF_RUN" ] || grep -q "$NAME" /proc/self/mounts ||
        [ -n "$(find /sys/fs/cgroup -maxdepth 2 -name "$NAME")" ]; then
        say "a process, folder, mount or control group of the daemon is left"; exit 1
    fi
}
trap end EXIT
trap 'exit 130' INT TERM

say "starting the daemon"
setpriv --pdeathsig KILL unshare --net --mount --pid --fork --kill-child --mount-proc sh -c '
    ip link set lo up
    for folder in /run /etc/docker /opt/containerd "$2"; do mkdir -p "$folder"; mount -t tmpfs tmpfs "$folder"; done
    tries=0
    until ip -4 -o addr show tap0 2>/dev/null | grep -q inet || [ $tries -gt 200 ]; do tries=$((tries + 1)); sleep 0.05; done
    exec tini -s -- dockerd "$@"' sh --data-root "$HOME_OF_RUN/data" --exec-root "$HOME_OF_RUN/exec" \
    --pidfile "$HOME_OF_RUN/pid" -H "unix://$HOME_OF_RUN/socket" --cgroup-parent "/$NAME" --mtu 1400 \
    >"$HOME_OF_RUN/log" 2>&1 </dev/null 9>&- &
OUTSIDE=$!
for _ in $(seq 200); do
    read -r DAEMON_PID _ <"/proc/$OUTSIDE/task/$OUTSIDE/children" || true
    [ -z "$DAEMON_PID" ] || break
    sleep 0.05
done
setpriv --pdeathsig KILL slirp4netns --configure --mtu=1400 --disable-host-loopback "$DAEMON_PID" tap0 \
    >"$HOME_OF_RUN/nat.log" 2>&1 </dev/null 9>&- &
NAT=$!

export DOCKER_HOST=unix://$HOME_OF_RUN/socket DOCKER_CONFIG=$CACHE/docker DAEMON_PID
export BASE_IMAGE=lalliance-base BUILD_CA=${SSL_CERT_FILE:-/etc/ssl/certs/ca-certificates.crt}
for _ in $(seq 240); do docker version >/dev/null 2>&1 && break; sleep 0.25; done
docker version >/dev/null 2>&1 || { tail -n 30 "$HOME_OF_RUN/log" >&2; say "the daemon did not start"; exit 1; }
docker import - "$BASE_IMAGE" <"$CACHE/base.tar" >/dev/null
say "running $*"
# Beside this script, which could not be told to end meanwhile otherwise.
"$@" &
COMMAND=$!
status=0; wait "$COMMAND" || status=$?
COMMAND=
exit $status
