#!/bin/sh
# Serves the viewer and models on this machine with nginx, and prints the address. Ctrl-C ends it.
#   serve.sh [--port N] [--folder DIR] [--log FILE] [--sources]
# DIR contains .ebpo.h5 files, .paint.h5 files for &paint=models/NAME.paint.h5, and scenes (.scene.json)
# with their models, poses and folders. The default is samples/out, which samples/quickstart.sh fills.
# The page is bundled each time; --sources serves it without a bundle. The script installs nothing and
# writes only to a temporary folder. It reports missing programs and files.
set -eu
here=$(cd "$(dirname "$0")/.." && pwd)
viewer=$here/tools/web port=8080 folder=$here/samples/out log='' bundle=yes
usage() {
    echo "usage: serve.sh [--port N] [--folder DIR] [--log FILE] [--sources]" >&2
    exit 2
}
while [ $# -gt 0 ]; do
    case $1 in --port | --folder | --log) [ $# -gt 1 ] || usage ;; esac
    case $1 in
    --port) port=$2; shift 2 ;;
    --folder) folder=$2; shift 2 ;;
    --log) log=$2; shift 2 ;;
    --sources) bundle=no; shift ;;
    *) usage ;;
    esac
done
missing() {
    echo "serve.sh: $1 is missing; run sh $here/tools/install-deps.sh --viewer" >&2
    exit 1
}
PATH=$PATH:/usr/sbin
command -v nginx >/dev/null || missing nginx
command -v node >/dev/null || missing node
[ -d "$viewer/node_modules/three" ] || missing "tools/web/node_modules"
[ -f "$viewer/ebpo/ebpo-view.wasm" ] || {
    echo "serve.sh: the npm package of the viewer is missing; run sh $here/tools/npm/build.sh build-npm" >&2
    exit 1
}
if ! ls "$folder"/*.ebpo.h5 >/dev/null 2>&1; then
    echo "serve.sh: $folder: no .ebpo.h5 file is there; choose a folder with --folder, or run" \
        "sh $here/samples/quickstart.sh for a sample" >&2
    exit 1
fi
folder=$(cd "$folder" && pwd)

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 0' INT TERM
mkdir -p "$work/www/models" "$work/tmp"
if [ $bundle = yes ] && [ ! -d "$viewer/node_modules/esbuild" ]; then
    echo "serve.sh: esbuild is missing, so the page is served without a bundle and loads slower;" \
        "npm ci in tools/web installs it" >&2
    bundle=no
fi
if [ $bundle = yes ]; then
    node "$viewer/bundle.mjs" "$work/www"
else
    for file in "$viewer"/*; do ln -s "$file" "$work/www/"; done
fi
for file in "$folder"/*.ebpo.h5 "$folder"/*.paint.h5 "$folder"/*.scene.json "$folder"/*.csv "$folder"/*/; do
    [ ! -e "$file" ] || ln -s "${file%/}" "$work/www/models/"
done
find -L "$work/www/models" -maxdepth 1 \( -name '*.ebpo.h5' -o -name '*.scene.json' \) \
    -exec node "$viewer/list.js" {} + >"$work/www/models/index.json" || {
    echo "serve.sh: $folder: none of its files can be shown" >&2
    exit 1
}

# A separate nginx without root and system folders. The page is sent compressed, models are not.
user=
[ "$(id -u)" = 0 ] && user="user root;"
cat >"$work/nginx.conf" <<END
$user worker_processes 1; daemon off; pid $work/pid; error_log stderr;
events { worker_connections 256; }
http {
    access_log ${log:-off};
    client_body_temp_path $work/tmp/a; proxy_temp_path $work/tmp/b;
    fastcgi_temp_path $work/tmp/c; uwsgi_temp_path $work/tmp/d; scgi_temp_path $work/tmp/e;
    types {
        text/html html; text/css css; text/javascript js mjs; application/json json;
        image/svg+xml svg; application/wasm wasm;
    }
    sendfile on; tcp_nopush on;
    gzip on; gzip_types text/css text/javascript application/json application/wasm; gzip_static on;
    server {
        listen 127.0.0.1:$port;
        root $work/www;
        include $here/samples/nginx-ebpo.conf;
    }
}
END
echo "http://localhost:$port/?samples=models/index.json"
nginx -e stderr -p "$work" -c "$work/nginx.conf" &
server=$!
trap 'kill $server 2>/dev/null; wait $server 2>/dev/null; exit 0' INT TERM
wait $server || {
    echo "serve.sh: nginx does not serve (see its message above); choose another port with --port" >&2
    exit 1
}
