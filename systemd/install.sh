#!/bin/sh
# Installs the recorder on a box, or takes it off again. May be run again and again: what is as it should be stays.
set -eu

usage() {
    cat <<'USAGE'
Usage: systemd/install.sh [--dry-run] [--root DIR] [--camera SSID [--interface NAME]]
       systemd/install.sh --uninstall [--dry-run] [--root DIR]

  --dry-run         say what would be done, and do nothing
  --root DIR        put the files below DIR, for an image; leave the running system alone
  --camera SSID     join the camera's Wi-Fi; its password is read from standard input
  --interface NAME  with this network interface (default: wlan0)
  --uninstall       remove all but the configuration, the recordings and the user

Run it as root from a checkout of the project. It needs python3-venv, and NetworkManager for --camera.
USAGE
}

fail() {
    echo "install.sh: $1" >&2
    exit "${2:-1}"
}

DRY_RUN=false
UNINSTALL=false
ROOT=
SSID=
INTERFACE=wlan0
while [ $# -gt 0 ]; do
    case $1 in
        --dry-run) DRY_RUN=true ;;
        --uninstall) UNINSTALL=true ;;
        --root) ROOT=${2:?--root needs a directory}; shift ;;
        --camera) SSID=${2:?--camera needs the name of the Wi-Fi}; shift ;;
        --interface) INTERFACE=${2:?--interface needs a name}; shift ;;
        -h | --help) usage; exit 0 ;;
        *) usage >&2; fail "there is no option $1." 2 ;;
    esac
    shift
done
ROOT=${ROOT%/}

HERE=$(cd "$(dirname "$0")" && pwd)
SOURCE=$(dirname "$HERE")
VENV=/opt/recorder
UNIT=/etc/systemd/system/recorder.service
SYSUSERS=/etc/sysusers.d/recorder.conf
TMPFILES=/etc/tmpfiles.d/recorder.conf
CONFIG=/etc/recorder/recorder.yaml
EXAMPLE=/etc/recorder/recorder.yaml.example
PAGE=/usr/local/share/doc/recorder/box.md
PROGRAM=/usr/local/bin/recorder
PROFILE=/etc/NetworkManager/system-connections/camera.nmconnection

run() {
    if $DRY_RUN; then
        echo "would run: $*"
    else
        "$@"
    fi
}

# Commands that change the system that is running, not files.
run_live() {
    if [ -z "$ROOT" ]; then
        run "$@"
    fi
}

put() { # mode, source, target
    if ! cmp -s "$2" "$ROOT$3"; then
        run install -D -m "$1" "$2" "$ROOT$3"
    fi
}

put_packages() {
    if [ -n "$ROOT" ]; then
        return # a virtual environment works only where it was made; install.sh makes it on the box
    fi
    [ -x "$VENV/bin/python" ] || run python3 -m venv "$VENV"
    run "$VENV/bin/python" -m pip install --quiet --disable-pip-version-check --require-hashes -r "$HERE/requirements.lock"
    run "$VENV/bin/python" -m pip install --quiet --disable-pip-version-check --no-deps --force-reinstall "$SOURCE"
}

put_profile() {
    [ -n "$SSID" ] || return 0
    if $DRY_RUN; then
        echo "would write: $ROOT$PROFILE"
        return 0
    fi
    if [ -t 0 ]; then
        echo "Password of $SSID (inside the camera's battery cover):" >&2
    fi
    IFS= read -r password || [ -n "$password" ] || fail "no password came on standard input."
    install -d -m 700 "$ROOT$(dirname "$PROFILE")"
    # Neither sed nor a command line gets to see the password. The subshell keeps the mask to itself.
    (
        umask 077
        while IFS= read -r line; do
            case $line in
                interface-name=*) echo "interface-name=$INTERFACE" ;;
                ssid=*) printf 'ssid=%s\n' "$SSID" ;;
                psk=*) printf 'psk=%s\n' "$password" ;;
                routing-rule2=*) echo "routing-rule2=priority 1065 oif $INTERFACE table 1064" ;;
                *) printf '%s\n' "$line" ;;
            esac
        done <"$HERE/camera.nmconnection" >"$ROOT$PROFILE"
    )
    run_live nmcli connection reload
}

install_all() {
    put 644 "$HERE/recorder.sysusers" "$SYSUSERS"
    put 644 "$HERE/recorder.tmpfiles" "$TMPFILES"
    run_live systemd-sysusers "$SYSUSERS"
    run_live systemd-tmpfiles --create "$TMPFILES"
    put_packages
    put 644 "$HERE/recorder.yaml" "$EXAMPLE"
    [ -e "$ROOT$CONFIG" ] || put 644 "$HERE/recorder.yaml" "$CONFIG"
    put 644 "$SOURCE/docs/box.md" "$PAGE"
    run install -d "$ROOT$(dirname "$PROGRAM")"
    run ln -sfn "$VENV/bin/recorder" "$ROOT$PROGRAM"
    put_profile
    put 644 "$HERE/recorder.service" "$UNIT"
    run_live systemctl daemon-reload
    run_live systemctl enable recorder.service
    run_live systemctl restart recorder.service
    $DRY_RUN || echo "Installed. Edit $CONFIG, then: systemctl restart recorder; systemctl status recorder"
}

uninstall_all() {
    if [ -e "$ROOT$UNIT" ]; then
        run_live systemctl disable --now recorder.service
    fi
    run rm -f "$ROOT$UNIT" "$ROOT$SYSUSERS" "$ROOT$TMPFILES" "$ROOT$EXAMPLE" "$ROOT$PAGE" "$ROOT$PROGRAM" "$ROOT$PROFILE"
    run rm -rf "$ROOT$VENV"
    run_live systemctl daemon-reload
    $DRY_RUN || echo "Uninstalled. Left: /etc/recorder, /var/lib/recorder with the recordings, and the user recorder."
}

if [ -z "$ROOT" ] && ! $DRY_RUN && [ "$(id -u)" -ne 0 ]; then
    fail "it has to be run as root; try sudo, or --dry-run."
fi
if $UNINSTALL; then
    uninstall_all
else
    install_all
fi
