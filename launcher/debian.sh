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

apt_get() {
    apt-get -q -o APT::Sandbox::User=root -o Acquire::Retries=3 "$@"
}

# The package lists of the host may be absent and are not touched: they are fetched to $tools.
fetch_debootstrap() {
    local own=(-o "Dir::State::Lists=$tools/lists" -o "Dir::Cache=$tools/cache") deb
    command -v apt-get >/dev/null || return 0
    stage "debootstrap"
    mkdir -p "$tools/lists/partial" "$tools/cache/archives/partial"
    (
        cd "$tools"
        apt_get download debootstrap debian-archive-keyring ||
            { apt_get "${own[@]}" update &&
                apt_get "${own[@]}" download debootstrap debian-archive-keyring; }
    )
    for deb in "$tools"/*.deb; do
        dpkg-deb -x "$deb" "$tools"
    done
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

# One mirror a line, an empty line for debootstrap's default: the user's, or else those from which
# apt takes the main part of this Debian's own release, then the default.
debian_mirrors() {
    local release
    if [[ -n ${UFL_ORIGAMI_MIRROR:-} ]]; then
        echo "$UFL_ORIGAMI_MIRROR"
        return
    fi
    release=$(. /etc/os-release && [[ ${ID:-} == debian ]] && echo "${VERSION_CODENAME:-}") || true
    if [[ -n $release ]]; then
        # shellcheck disable=SC2016
        apt-get indextargets --format '$(RELEASE) $(COMPONENT) $(REPO_URI)' 'Identifier: Packages' |
            awk -v release="$release" '$1 == release && $2 == "main" && $3 ~ /^https?:/ { print $3 }'
    fi
    echo
}

# The proxies of the host's apt, in apt's own syntax; http_proxy and the like pass by themselves.
apt_proxies() {
    if command -v apt-config >/dev/null; then
        apt-config dump | grep -E '^Acquire::(http|https)::(Proxy|proxy)(::[^ ]+)? ' || true
    fi
}
