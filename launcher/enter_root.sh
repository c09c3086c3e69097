#!/usr/bin/env bash
# Become COMMAND inside a built root: bash enter_root.sh TARGET UID GID COMMAND...
#
# Runs as root of a fresh mount namespace. A new tree is put together on a tmpfs: the system folders
# (/usr and /etc, read-only) come from TARGET/root, every other top-level folder from the host, under
# its own name. When the command ends, the kernel takes the namespace with all its mounts away.
set -euo pipefail

repo=$(dirname "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")")
source "$repo/launcher/common.sh"
target=$1 uid=$2 gid=$3
shift 3
root=$target/root
folder=$PWD
PATH=$PATH:/usr/sbin:/sbin
certificates=$(host_certificates)

# Mounts are collected in the form of an fstab, for one call of mount: ADD SOURCE TARGET OPTIONS
table=
add() {
    local source=${1// /\\040} place=${2// /\\040}
    table+="$source $place none $3 0 0"$'\n'
}

# Read-only, with the flags of the file system beneath, which an ordinary user may not drop.
flags=$(findmnt -n -r -o VFS-OPTIONS -T "$root" | tail -n 1)
add_system() { add "$root/$1" "$new/$1" "bind,ro,${flags#*,}"; }

lay_out_host() {
    local entry folders=()
    for entry in /*; do
        case $entry in
            /bin | /boot | /etc | /lib | /lib32 | /lib64 | /libx32 | /lost+found | /sbin | /usr)
                continue ;;
        esac
        if [[ -L $entry ]]; then
            cp -P "$entry" "$new$entry"
        elif [[ -d $entry ]]; then
            folders+=("$new$entry")
            add "$entry" "$new$entry" rbind
        fi
    done
    mkdir "${folders[@]}"
}

lay_out_system() {
    local name
    for name in bin sbin lib lib32 lib64 libx32; do
        if [[ -L $root/$name ]]; then cp -P "$root/$name" "$new/$name"; fi
    done
    mkdir "$new/usr" "$new/etc" "$new/.host"
    add_system usr
    add_system etc
    for name in var/lib/dpkg var/lib/apt var/cache/apt; do
        if [[ -d /$name ]]; then add_system "$name"; fi
    done
}

# Who the users are, how names are resolved, what is trusted: as on the host.
lay_out_settings() {
    local name
    for name in passwd group hosts hostname resolv.conf localtime machine-id pip.conf; do
        if [[ -f /etc/$name ]]; then add "/etc/$name" "$new/etc/$name" bind; fi
    done
    if [[ -n $certificates ]]; then
        add "$certificates" "$new/etc/ssl/certs/ca-certificates.crt" bind
    fi
}

# A folder that the user works in may lie below /usr or /etc, where the root has nothing.
lay_out_own_folders() {
    local path
    for path in "$folder" "${HOME:-/}" "$repo" "$UFL_ORIGAMI_CACHE" "${TMPDIR:-/}"; do
        case $path in
            /usr/* | /etc/*)
                mkdir -p "$root$path"
                if [[ -d $path && -z $(ls -A "$root$path") ]]; then add "$path" "$new$path" rbind; fi ;;
        esac
    done
}

new=$UFL_ORIGAMI_CACHE/tree
mkdir -p "$new"
# Unbindable, or binding the folder that holds it would bind the tree into itself.
mount -t tmpfs --make-unbindable -o mode=755 tmpfs "$new"
lay_out_host
lay_out_system
lay_out_settings
lay_out_own_folders
printf '%s' "$table" >"$new/.host/fstab"
mount --all --fstab "$new/.host/fstab" || say "some folders of this machine are missing inside"
# Only root may make the folder for X sockets.
[[ -d /tmp/.X11-unix ]] || mkdir -m 1777 /tmp/.X11-unix

pivot_root "$new" "$new/.host"
cd /
forget_host_software
umount -l /.host
for name in SSL_CERT_FILE REQUESTS_CA_BUNDLE CURL_CA_BUNDLE PIP_CERT GIT_SSL_CAINFO; do
    if [[ -n ${!name:-} ]]; then export "$name=/etc/ssl/certs/ca-certificates.crt"; fi
done
unset UFL_ORIGAMI_ENV
export UFL_ORIGAMI_INSIDE=${target##*/}
own_caches "$UFL_ORIGAMI_INSIDE"
common_environment
cd "$folder" || fail "the working folder $folder is not visible inside the environment"
if ((uid == 0)); then
    exec -- "$@"
fi
exec unshare --user --map-user="$uid" --map-group="$gid" -- "$@"
