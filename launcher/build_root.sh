#!/usr/bin/env bash
# Fill PART/root with Debian 13 and the packages of packages.txt: bash build_root.sh PART
# Runs as root of a mount and process namespace of its own (root.sh), where chown may be ignored.
set -euo pipefail

repo=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")
source "$repo/launcher/common.sh"
source "$repo/launcher/debian.sh"
suite=trixie
part=$1
root=$part/root
tools=$part/tools

stage() {
    echo "== $*"
    say "  $*" 2>&3
}

require_space() {
    local free
    free=$(df -m --output=avail "$part" | tail -n 1)
    ((free >= 5000)) || { echo "no space left: 5000 MB are needed, $free MB are free" && exit 1; }
}

# Devices as binds of the host's, since mknod may be forbidden; debootstrap keeps what is there.
make_devices() {
    local name
    mkdir -p "$root/dev"
    mount -t tmpfs -o mode=755 tmpfs "$root/dev"
    for name in null zero full random urandom tty console ptmx; do
        touch "$root/dev/$name"
        if [[ -e /dev/$name ]]; then mount --bind "/dev/$name" "$root/dev/$name"; fi
    done
}

bootstrap() {
    local mirror
    for mirror in "${mirrors[@]}"; do
        stage "base system from ${mirror:-the default mirror of debootstrap}"
        # With container=lxc debootstrap does not insist on mknod.
        if container=lxc DEBOOTSTRAP_DIR=$debootstrap_dir "$debootstrap" --variant=minbase \
            --force-check-gpg --keyring="$keyring" "$suite" "$root" ${mirror:+"$mirror"}; then
            return
        fi
        tail -n 5 "$root/debootstrap/debootstrap.log" 2>/dev/null || true
    done
    return 1
}

configure_apt() {
    local certificates proxy
    cat >"$root/etc/apt/apt.conf.d/80ufl-origami" <<'CONF'
APT::Install-Recommends "false";
APT::Sandbox::User "root";
Acquire::Retries "3";
Acquire::Languages "none";
Dpkg::Use-Pty "false";
CONF
    printf '%s\n' force-unsafe-io 'path-exclude=/usr/share/doc/*' 'path-exclude=/usr/share/man/*' \
        'path-exclude=/usr/share/locale/*' 'path-include=/usr/share/doc/*/copyright' \
        >"$root/etc/dpkg/dpkg.cfg.d/ufl-origami"
    proxy=$(apt_proxies)
    printf '%s\n' "$proxy" >"$root/etc/apt/apt.conf.d/90host"
    certificates=$(host_certificates)
    if [[ -n $certificates ]]; then
        cp "$certificates" "$root/host-certificates.crt"
        echo 'Acquire::https::CAInfo "/host-certificates.crt";' >>"$root/etc/apt/apt.conf.d/90host"
    fi
}

in_root() { chroot "$root" /usr/bin/env PATH=/usr/sbin:/usr/bin:/sbin:/bin "$@"; }

install_packages() {
    local packages
    mapfile -t packages < <(sed 's/#.*//' "$repo/packages.txt" | xargs -n 1)
    mount -t proc proc "$root/proc"
    in_root apt-get update
    in_root apt-get install -y "${packages[@]}"
    in_root apt-get clean
}

# The files that enter_root.sh lays the host's own over, and no trace of the build.
finish() {
    local name
    for name in passwd group hosts hostname resolv.conf localtime machine-id pip.conf; do
        if [[ -L $root/etc/$name ]]; then rm "$root/etc/$name"; fi
        touch "$root/etc/$name"
    done
    rm -rf "$root/host-certificates.crt" "$root/etc/apt/apt.conf.d/90host" "$tools"
    rm -rf "$root"/var/lib/apt/lists/* "$root"/var/log/* "$root/debootstrap"
    umount "$root/proc" "$root"/dev/* 2>/dev/null || true
    umount "$root/dev"
}

export DEBIAN_FRONTEND=noninteractive DEBCONF_NONINTERACTIVE_SEEN=true LC_ALL=C.UTF-8 TMPDIR=/tmp
export HOME=/root
unset PYTHONPATH PYTHONHOME LD_PRELOAD LD_LIBRARY_PATH
umask 022
require_space
mkdir "$root" "$tools"
find_debootstrap
find_mirrors
make_devices
bootstrap
configure_apt
stage "packages (650 MB to download)"
install_packages
stage "check"
in_root python3 - <"$repo/launcher/smoke.py"
finish
