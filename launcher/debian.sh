# Where Debian comes from on this host: debootstrap, its keys and the mirror. Sourced by
# build_root.sh; needs $tools. No mirror is named here: apt's or debootstrap's own is used.

# Set debootstrap, debootstrap_dir and keyring: the installed ones, or fetched by apt into $tools.
find_debootstrap() {
    local prefix
    for prefix in "" "$tools"; do
        if [[ -n $prefix ]]; then fetch_debootstrap; fi
        debootstrap=$prefix/usr/sbin/debootstrap
        debootstrap_dir=$prefix/usr/share/debootstrap
        keyring=$prefix/usr/share/keyrings/debian-archive-keyring.gpg
        [[ -x $debootstrap && -e $keyring ]] && break
    done
    [[ -x $debootstrap && -e $keyring ]] || {
        echo "debootstrap and debian-archive-keyring are needed: install both packages" && return 1
    }
    if [[ -x /usr/lib/apt/apt-helper ]]; then
        use_apt_to_download
    fi
}

apt_options=(-q -o APT::Sandbox::User=root -o Acquire::Retries=3)
apt_get() { apt-get "${apt_options[@]}" "$@"; }

# The package lists of the host may be absent or old, and are not touched: fetch others to $tools.
fetch_lists() {
    mkdir -p "$tools/lists/partial" "$tools/cache/archives/partial"
    apt_options+=(-o "Dir::State::Lists=$tools/lists" -o "Dir::Cache=$tools/cache")
    apt_get update
}

fetch_debootstrap() {
    local deb
    command -v apt-get >/dev/null || return 0
    stage "debootstrap"
    cd "$tools"
    apt_get download debootstrap debian-archive-keyring ||
        { fetch_lists && apt_get download debootstrap debian-archive-keyring; }
    for deb in ./*.deb; do
        dpkg-deb -x "$deb" "$tools"
    done
    cd /
}

# debootstrap calls wget, which a small system lacks; apt downloads with the proxy that it knows.
use_apt_to_download() {
    mkdir -p "$tools/bin"
    cat >"$tools/bin/wget" <<'WGET'
#!/usr/bin/env bash
while (($# > 1)); do
    if [[ $1 == -O ]]; then file=$2; fi
    shift
done
rm -f "$file"
exec /usr/lib/apt/apt-helper -o APT::Sandbox::User=root -o Acquire::Retries=3 \
    download-file "$1" "$file"
WGET
    chmod +x "$tools/bin/wget"
    export PATH=$tools/bin:$PATH
}

# The mirrors from which apt takes the main part of Debian release $1.
apt_mirrors() {
    # shellcheck disable=SC2016
    apt_get indextargets --format '$(RELEASE) $(COMPONENT) $(REPO_URI)' 'Identifier: Packages' |
        awk -v release="$1" '$1 == release && $2 == "main" && $3 ~ /^https?:/ { print $3 }'
}

# Set mirrors to what is tried in turn: the user's; or else apt's, if this host is a Debian, and
# debootstrap's default, which is the empty word.
find_mirrors() {
    local release
    mapfile -t mirrors <<<"${UFL_ORIGAMI_MIRROR:-}"
    release=$(. /etc/os-release && [[ ${ID:-} == debian ]] && echo "${VERSION_CODENAME:-}") || true
    if [[ -z ${UFL_ORIGAMI_MIRROR:-} && -n $release ]]; then
        if [[ -z $(apt_mirrors "$release") ]]; then fetch_lists || true; fi
        mapfile -t mirrors < <(apt_mirrors "$release" && echo)
    fi
}

# The proxies of the host's apt, in apt's own syntax; http_proxy and the like pass by themselves.
apt_proxies() {
    if command -v apt-config >/dev/null; then
        apt-config dump | grep -E '^Acquire::(http|https)::(Proxy|proxy)(::[^ ]+)? ' || true
    fi
}
