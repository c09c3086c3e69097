# Messages and variables that every part of the launcher shares. Sourced; needs $repo.

say() { printf 'ufl_origami: %s\n' "$*" >&2; }

fail() {
    say "$@"
    exit 2
}

# Variables of every environment; a value that the user has set stays.
common_environment() {
    export OMP_NUM_THREADS=${OMP_NUM_THREADS:-1}
    export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
    export OMPI_MCA_btl=${OMPI_MCA_btl:-self,sm}
    export OMPI_MCA_mpi_yield_when_idle=${OMPI_MCA_mpi_yield_when_idle:-1} # waiting ranks make room
    export PRTE_MCA_rmaps_default_mapping_policy=${PRTE_MCA_rmaps_default_mapping_policy:-:oversubscribe}
    case :${PYTHONPATH:-}: in
        *:"$repo":*) ;;
        *) export PYTHONPATH=$repo${PYTHONPATH:+:$PYTHONPATH} ;;
    esac
}

# Compiled code is kept apart for each environment: $1 names the environment.
own_caches() {
    export XDG_CACHE_HOME=$UFL_ORIGAMI_CACHE/jit/$1
    export NUMBA_CACHE_DIR=$XDG_CACHE_HOME/numba
}

# Inside a root file system or a container nothing of the host's own software may be picked up.
forget_host_software() {
    unset PYTHONPATH PYTHONHOME PYTHONSTARTUP VIRTUAL_ENV LD_LIBRARY_PATH LD_PRELOAD
    unset CC CXX CPP CFLAGS CXXFLAGS CPPFLAGS LDFLAGS CPATH LIBRARY_PATH PKG_CONFIG_PATH
    unset PETSC_DIR PETSC_ARCH SLEPC_DIR SLEPC_ARCH LANGUAGE LOCPATH
    export PYTHONNOUSERSITE=1 LANG=C.UTF-8 LC_ALL=C.UTF-8
    export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
}

# The certificates that the host trusts, in one file, or nothing.
host_certificates() {
    local file
    for file in "${SSL_CERT_FILE:-}" /etc/ssl/certs/ca-certificates.crt \
        /etc/pki/tls/certs/ca-bundle.crt /etc/ssl/ca-bundle.pem /etc/ssl/cert.pem; do
        if [[ -s $file ]]; then
            printf '%s\n' "$file"
            return
        fi
    done
}
