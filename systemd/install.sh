#!/bin/sh
# Installs the recorder on a box, or takes it off again. May be run again and again: what is as it should be stays.
set -eu

usage() {
    cat <<'USAGE'
Usage: systemd/install.sh [--dry-run] [--root DIR] [--driver NAME] [--camera SSID [--interface NAME]]
       systemd/install.sh --uninstall [--dry-run] [--root DIR]
       systemd/install.sh --program-only DIR [--driver NAME]

  --dry-run           say what would be done, and do nothing
  --root DIR          put the files below DIR, for an image; leave the running system alone
  --driver NAME       what the camera needs: qx10, uvc, picamera or rtsp (default: as the configuration that is there has
                      it, or qx10)
  --camera SSID       join the camera's Wi-Fi; its password is read from standard input
  --interface NAME    with this network interface (default: wlan0)
  --uninstall         remove all but the configuration, the recordings and the user
  --program-only DIR  put the program into DIR/bin, as on the box, and touch nothing else; anybody may

Run it as root from a checkout of the project. It needs python3-venv, NetworkManager and wpasupplicant for --camera, and
rpicam-apps-lite for picamera.
USAGE
}

fail() {
    echo "install.sh: $1" >&2
    exit "${2:-1}"
}

refuse() { # why it cannot be installed
    $DRY_RUN || fail "$1"
    echo "would fail: $1"
}

needs() { # option, its value
    [ -n "${2:-}" ] || fail "$1 needs a value; --help says which." 2
}

# Whoever installs may keep their own files to themselves; the recorder's user has to read these.
umask 022

DRY_RUN=false
ACTION=install_all
ROOT=
DRIVER=
SSID=
INTERFACE=wlan0
VENV=/opt/recorder
while [ $# -gt 0 ]; do
    case $1 in
        --dry-run) DRY_RUN=true ;;
        --uninstall) ACTION=uninstall_all ;;
        --root) needs "$@"; ROOT=$2; shift ;;
        --driver) needs "$@"; DRIVER=$2; shift ;;
        --camera) needs "$@"; SSID=$2; shift ;;
        --interface) needs "$@"; INTERFACE=$2; shift ;;
        --program-only) needs "$@"; ACTION=put_packages; VENV=$2; shift ;;
        -h | --help) usage; exit 0 ;;
        *) usage >&2; fail "there is no option $1." 2 ;;
    esac
    shift
done
ROOT=${ROOT%/}

HERE=$(cd "$(dirname "$0")" && pwd)
SOURCE=$(dirname "$HERE")
UNIT=/etc/systemd/system/recorder.service
DROP_IN=/etc/systemd/system/recorder.service.d/devices.conf
RULES=/etc/udev/rules.d/60-recorder.rules
SYSUSERS=/etc/sysusers.d/recorder.conf
TMPFILES=/etc/tmpfiles.d/recorder.conf
CONFIG=/etc/recorder/recorder.yaml
EXAMPLE=/etc/recorder/recorder.yaml.example
PAGE=/usr/local/share/doc/recorder/box.md
CAMERAS=/usr/local/share/doc/recorder/cameras.md
PROGRAM=/usr/local/bin/recorder
PROFILE=/etc/NetworkManager/system-connections/camera.nmconnection

# What a configuration that is there asks for stays installed, whoever runs this again.
if [ -z "$DRIVER" ] && [ "$ACTION" = install_all ] && [ -r "$ROOT$CONFIG" ]; then
    DRIVER=$(sed -n 's/^[^#]*driver["'"'"']\{0,1\} *: *["'"'"']\{0,1\}\([a-z0-9][a-z0-9]*\).*/\1/p' "$ROOT$CONFIG" | head -n 1)
    [ -n "$DRIVER" ] || fail "$CONFIG names no driver beside its key; give --driver."
    [ "$DRIVER" != replay ] || DRIVER=qx10
fi
DRIVER=${DRIVER:-qx10}
case $DRIVER in
    qx10) SAMPLE=$HERE/recorder.yaml ;;
    uvc | picamera | rtsp) SAMPLE=$HERE/recorder-$DRIVER.yaml ;;
    *) fail "there is no driver $DRIVER; --help lists them." 2 ;;
esac

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

pip_install() {
    run "$VENV/bin/python" -m pip install --quiet --disable-pip-version-check "$@"
}

put_packages() {
    # Also where making it was cut short, or the system's upgrade brought another Python.
    "$VENV/bin/python" -m pip --version >/dev/null 2>&1 || run python3 -m venv "$VENV"
    pip_install --require-hashes --no-deps -r "$HERE/requirements.lock"
    if [ "$DRIVER" = rtsp ]; then # FFmpeg, 100 MB, which nothing else on the box needs
        pip_install --require-hashes --no-deps -r "$HERE/requirements-video.lock"
    fi
    pip_install --no-deps --no-build-isolation --force-reinstall "$SOURCE"
}

put_profile() { # its text
    install -d -m 700 "$ROOT$(dirname "$PROFILE")"
    rm -f "$ROOT$PROFILE"
    # No command line gets to see the password. The subshell keeps the mask to itself.
    (umask 077 && printf '%s\n' "$1" >"$ROOT$PROFILE")
    run_live nmcli connection reload
}

put_devices() {
    case $DRIVER in
        uvc | picamera)
            put 644 "$HERE/devices.conf" "$DROP_IN"
            put 644 "$HERE/recorder.rules" "$RULES"
            ;;
        *) run rm -f "$ROOT$DROP_IN" "$ROOT$RULES" ;;
    esac
    run_live udevadm control --reload
    run_live udevadm trigger --subsystem-match=dma_heap
}

is_there() { # a command, also where root's PATH lacks the system's own
    (PATH=$PATH:/usr/sbin:/sbin; command -v "$1" >/dev/null)
}

check_network() {
    if [ -z "$ROOT" ] && ! [ -e "/sys/class/net/$INTERFACE" ]; then
        refuse "there is no network interface $INTERFACE; \`ip link\` lists them: give the Wi-Fi's with --interface."
    fi
    if [ -z "$ROOT" ] && ! is_there wpa_supplicant && ! [ -x /usr/libexec/iwd ]; then
        refuse "NetworkManager joins no Wi-Fi without wpa_supplicant; install it: apt-get install wpasupplicant"
    fi
    if grep -Eqs "^[[:space:]]*iface[[:space:]]+$INTERFACE([[:space:]]|\$)" \
        "$ROOT/etc/network/interfaces" "$ROOT"/etc/network/interfaces.d/*; then
        refuse "NetworkManager leaves $INTERFACE alone while /etc/network/interfaces names it; take it out of there."
    fi
}

install_all() {
    profile=
    if [ "$DRIVER" = picamera ] && [ -z "$ROOT" ] && ! is_there rpicam-vid; then
        refuse "there is no rpicam-vid; install it: apt-get install rpicam-apps-lite"
    fi
    if [ -n "$SSID" ]; then
        check_network
    fi
    if [ -n "$SSID" ] && ! $DRY_RUN; then # before anything is changed: it may be refused
        profile=$(python3 "$HERE/camera_profile.py" "$SSID" "$INTERFACE") || exit 1
    fi
    put 644 "$HERE/recorder.sysusers" "$SYSUSERS"
    put 644 "$HERE/recorder.tmpfiles" "$TMPFILES"
    run_live systemd-sysusers "$SYSUSERS"
    run_live systemd-tmpfiles --create "$TMPFILES"
    if [ -z "$ROOT" ]; then # a virtual environment works only where it was made; on the box it is made by this script
        put_packages
    fi
    put 644 "$SAMPLE" "$EXAMPLE"
    [ -e "$ROOT$CONFIG" ] || put 644 "$SAMPLE" "$CONFIG"
    put 644 "$SOURCE/docs/box.md" "$PAGE"
    put 644 "$SOURCE/docs/cameras.md" "$CAMERAS"
    run install -d "$ROOT$(dirname "$PROGRAM")"
    run ln -sfn "$VENV/bin/recorder" "$ROOT$PROGRAM"
    if [ -n "$profile" ]; then
        put_profile "$profile"
    elif [ -n "$SSID" ]; then
        echo "would write: $ROOT$PROFILE"
    fi
    put 644 "$HERE/recorder.service" "$UNIT"
    put_devices
    run_live systemctl daemon-reload
    run_live systemctl enable recorder.service
    run_live sync # the next thing to happen to the board may be that its plug is pulled
    run_live systemctl restart recorder.service
    $DRY_RUN || echo "Installed. Edit $CONFIG, then: systemctl restart recorder; systemctl status recorder"
}

uninstall_all() {
    if [ -e "$ROOT$UNIT" ]; then
        run_live systemctl disable --now recorder.service
    fi
    run rm -f "$ROOT$UNIT" "$ROOT$SYSUSERS" "$ROOT$TMPFILES" "$ROOT$EXAMPLE" "$ROOT$PAGE" "$ROOT$CAMERAS"
    run rm -f "$ROOT$PROGRAM" "$ROOT$PROFILE" "$ROOT$DROP_IN" "$ROOT$RULES"
    run rm -rf "$ROOT$VENV"
    run_live systemctl daemon-reload
    $DRY_RUN || echo "Uninstalled. Left: /etc/recorder, /var/lib/recorder with the recordings, and the user recorder."
}

if [ -z "$ROOT" ] && ! $DRY_RUN && [ "$ACTION" != put_packages ] && [ "$(id -u)" -ne 0 ]; then
    fail "it has to be run as root; try sudo, or --dry-run."
fi
$ACTION
