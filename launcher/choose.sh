# Which environment runs the command. Sourced by run; needs $repo, $cache and common.sh.

# The name changes with the package list and with the way in which the root is built.
root_name() {
    local sum
    sum=$(cat "$repo/packages.txt" "$repo/launcher/build_root.sh" | sha256sum)
    printf 'trixie-%s-%s' "$(uname -m)" "${sum:0:12}"
}

namespace_flags() {
    if ((EUID == 0)); then
        echo --mount --propagation slave
    else
        echo --user --map-root-user --mount --propagation slave
    fi
}

can_unshare() {
    # shellcheck disable=SC2046
    unshare $(namespace_flags) mount -t tmpfs tmpfs /tmp 2>/dev/null
}

no_namespaces() {
    say "this machine does not let you make a mount namespace, which the Debian root needs."
    say "Either run the command with sudo, or allow user namespaces (Ubuntu: sudo sysctl -w"
    say "kernel.apparmor_restrict_unprivileged_userns=0), or start Docker or Podman and set"
    fail "UFL_ORIGAMI_ENV=docker (or podman); in a container, give it --privileged."
}

build_root() {
    mkdir -p "$cache" 2>/dev/null && [[ -w $cache ]] ||
        fail "cannot write to the cache folder $cache; set UFL_ORIGAMI_CACHE to another one"
    bash "$repo/launcher/root.sh" "$cache/$name"
}

enter_root() {
    can_unshare || no_namespaces
    # shellcheck disable=SC2046
    exec unshare $(namespace_flags) \
        bash "$repo/launcher/enter_root.sh" "$cache/$name" "$(id -u)" "$(id -g)" "$@"
}

native_problem() {
    command -v python3 >/dev/null || { echo "there is no python3" && return; }
    python3 "$repo/launcher/native.py" 2>&1 || true
}

run_native() {
    export UFL_ORIGAMI_INSIDE=${UFL_ORIGAMI_INSIDE:-native}
    unset UFL_ORIGAMI_ENV
    own_caches "$UFL_ORIGAMI_INSIDE"
    common_environment
    exec -- "$@"
}

container_engine() {
    local engine
    for engine in docker podman; do
        if command -v "$engine" >/dev/null && "$engine" info >/dev/null 2>&1; then
            echo "$engine"
            return
        fi
    done
}

run_automatic() {
    local problem engine
    if [[ -e $cache/$name/.ready ]]; then enter_root "$@"; fi
    problem=$(native_problem)
    if [[ -z $problem ]]; then run_native "$@"; fi
    if can_unshare; then
        say "not using this machine's python3: $problem"
        build_root
        enter_root "$@"
    fi
    engine=$(container_engine)
    [[ -n $engine ]] || no_namespaces
    exec bash "$repo/launcher/container.sh" "$engine" "$name" "$@"
}

run_in_environment() {
    local name problem
    name=$(root_name)
    case ${UFL_ORIGAMI_ENV:-auto} in
        auto)
            # A command started from inside the environment stays there.
            case ${UFL_ORIGAMI_INSIDE:-} in
                "$name" | native) run_native "$@" ;;
            esac
            run_automatic "$@" ;;
        root)
            can_unshare || no_namespaces
            [[ -e $cache/$name/.ready ]] || build_root
            enter_root "$@" ;;
        native)
            problem=$(native_problem)
            [[ -z $problem ]] || fail "UFL_ORIGAMI_ENV=native, but $problem"
            run_native "$@" ;;
        docker | podman)
            exec bash "$repo/launcher/container.sh" "$UFL_ORIGAMI_ENV" "$name" "$@" ;;
        *) fail "UFL_ORIGAMI_ENV is '$UFL_ORIGAMI_ENV'; it may be root, native, docker or podman" ;;
    esac
}
