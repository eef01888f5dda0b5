#!/bin/sh
# The viewer and models on this machine: installs nginx and what the viewer needs, serves, and
# prints the address. Ends with Ctrl-C.
#   serve.sh [--port N] [--folder DIR] [--log FILE] [--no-install]
# DIR holds .ebpo.h5 files (samples/out, which samples/quickstart.sh fills). Nothing is written
# outside a temporary folder and tools/viewer/node_modules.
set -eu
here=$(cd "$(dirname "$0")/.." && pwd)
viewer=$here/tools/viewer port=8080 folder=$here/samples/out log='' install=yes
while [ $# -gt 0 ]; do
    case $1 in
    --port) port=$2; shift 2 ;;
    --folder) folder=$(cd "$2" && pwd); shift 2 ;;
    --log) log=$2; shift 2 ;;
    --no-install) install=no; shift ;;
    *) echo "usage: serve.sh [--port N] [--folder DIR] [--log FILE] [--no-install]" >&2; exit 2 ;;
    esac
done
if [ $install = yes ]; then
    sh "$here/tools/install-deps.sh" --viewer
    ls "$folder"/*.ebpo.h5 >/dev/null 2>&1 || sh "$here/samples/quickstart.sh"
fi
if ! ls "$folder"/*.ebpo.h5 >/dev/null 2>&1; then
    echo "serve.sh: $folder: no .ebpo.h5 file is there; run samples/quickstart.sh," \
        "or name a folder with --folder" >&2
    exit 1
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 0' INT TERM
mkdir -p "$work/www/models" "$work/tmp"
for file in "$viewer"/*; do ln -s "$file" "$work/www/"; done
for file in "$folder"/*.ebpo.h5; do ln -s "$file" "$work/www/models/"; done
node "$viewer/list.js" "$work"/www/models/*.ebpo.h5 >"$work/www/models/index.json"

# An nginx of one's own: no root, no system folders. Scripts are compressed on the way, models
# never.
user=
[ "$(id -u)" = 0 ] && user="user root;"
cat >"$work/nginx.conf" <<END
$user worker_processes 1; daemon off; pid $work/pid; error_log stderr;
events { worker_connections 256; }
http {
    access_log ${log:-off};
    client_body_temp_path $work/tmp/a; proxy_temp_path $work/tmp/b;
    fastcgi_temp_path $work/tmp/c; uwsgi_temp_path $work/tmp/d; scgi_temp_path $work/tmp/e;
    types { text/html html; text/css css; text/javascript js mjs; application/json json; image/svg+xml svg; }
    sendfile on; tcp_nopush on;
    gzip on; gzip_types text/css text/javascript application/json;
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
wait $server
