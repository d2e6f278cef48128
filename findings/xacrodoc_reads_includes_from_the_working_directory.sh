#!/usr/bin/env bash
# xacrodoc 2.0.1, XacroDoc.from_file: a relative <xacro:include> beside the file is looked for in the
# working directory, although xacro itself reads it from the folder of the file that includes it.
# Seen: xacro 1 link, xacrodoc in the folder 1 link, xacrodoc elsewhere XacroException
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q xacrodoc==2.0.1 xacro==2.1.1
mkdir "$folder/robot"
head='xmlns:xacro="http://www.ros.org/wiki/xacro"'
echo "<robot name='r' $head><xacro:include filename='parts.xacro'/></robot>" > "$folder/robot/robot.xacro"
echo "<robot $head><link name='base'/></robot>" > "$folder/robot/parts.xacro"
read_it() {
    "$folder/venv/bin/python" - "$1" "$2" <<'END'
import sys

import xacro
from xacrodoc import XacroDoc

try:
    if sys.argv[1] == "xacro":
        text = xacro.process_file(sys.argv[2]).toxml()
    else:
        text = XacroDoc.from_file(sys.argv[2]).to_urdf_string()
    print(text.count("<link"), "link")
except Exception as error:
    print(type(error).__name__)
END
}
cd "$folder"
by_xacro=$(read_it xacro robot/robot.xacro)
elsewhere=$(read_it xacrodoc robot/robot.xacro)
cd robot
inside=$(read_it xacrodoc robot.xacro)
found="xacro $by_xacro, xacrodoc in the folder $inside, xacrodoc elsewhere $elsewhere"
echo "$found"
test "$found" = "xacro 1 link, xacrodoc in the folder 1 link, xacrodoc elsewhere XacroException"
