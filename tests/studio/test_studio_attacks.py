"""What a stranger's page, or program, may try: each is refused, and nothing is touched."""

import json
import shutil
import socket

import pytest
from asking import OLD, Client, contents

from evocity.studio.guard import FILE as ADDRESS
from evocity.studio.guard import FILE_KIND, HEADER, MOST_BODY, MOST_FILE, POLICY
from evocity.studio.server import HOST, running_server
from evocity.viewer.sheet import MOST

JSON = ("Content-Type", "application/json")
FILE = ("Content-Type", FILE_KIND)
PICK = json.dumps({"change": "pick", "ids": [3]}).encode()


@pytest.fixture(scope="module")
def outside(tmp_path_factory):
    return tmp_path_factory.mktemp("outside")


@pytest.fixture(scope="module")
def attacked(outside):
    """A client with its cookie, and all that lay there before."""
    night = shutil.copytree(OLD / "run-6", outside / "runs" / "night")
    (outside / "secret.txt").write_text("the secret")
    before = contents(outside)
    with running_server(night) as server:
        client = Client(server)
        client.open()
        yield client
    assert contents(outside) == before


def own(client: Client) -> str:
    return f"127.0.0.1:{client.server.port}"


@pytest.mark.parametrize(
    "host",
    [
        ["evil.example"],
        ["evil.example:{port}"],
        ["127.0.0.1"],
        ["127.0.0.1:1"],
        ["127.0.0.1:{port}@evil.example"],
        ["127.0.0.1.evil.example:{port}"],
        ["0.0.0.0:{port}"],
        ["127.1:{port}"],
        ["LOCALHOST:{port}"],
        ["localhost.:{port}"],
        ["127.0.0.1:{port}, evil.example"],
        [""],
    ],
    ids=str,
)
@pytest.mark.parametrize("path", ["/", "/api/0/births", "/nothing", "/page/studio.js"])
def test_another_host_is_refused_before_anything_is_looked_for(attacked, host, path):
    hosts = [one.format(port=attacked.server.port) for one in host]
    assert attacked.ask("GET", path, host=hosts).status == 421


@pytest.mark.parametrize("hosts", [[], ["127.0.0.1:{port}", "evil.example"]], ids=str)
def test_no_host_and_two_hosts_are_refused(attacked, hosts):
    hosts = [one.format(port=attacked.server.port) for one in hosts]
    assert attacked.ask("GET", "/api/0/births", host=hosts).status in (400, 421)


@pytest.mark.parametrize("name", ["localhost", "[::1]"])
def test_other_names_of_this_machine_are_its_own(attacked, name):
    told = attacked.ask("GET", "/api/0/picks", host=[f"{name}:{attacked.server.port}"])
    assert told.status == 200


@pytest.mark.parametrize(
    "headers",
    [
        [("Origin", "http://evil.example")],
        [("Origin", "null")],
        [("Origin", "https://127.0.0.1:{port}")],
        [("Origin", "http://127.0.0.1")],
        [("Origin", "http://localhost:{port}")],
        [("Origin", "http://127.0.0.1:{port}"), ("Origin", "http://evil.example")],
        [("Sec-Fetch-Site", "cross-site")],
        [("Sec-Fetch-Site", "same-site")],
        [("Sec-Fetch-Site", "something new")],
        [("Origin", "http://127.0.0.1:{port}"), ("Sec-Fetch-Site", "cross-site")],
    ],
    ids=str,
)
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_another_site_is_refused(attacked, headers, method):
    pairs = [(name, value.format(port=attacked.server.port)) for name, value in headers]
    if method == "POST":
        told = attacked.ask("POST", "/api/0/pick", [*pairs, JSON, HEADER], PICK)
    else:
        told = attacked.ask("GET", "/api/0/births", pairs)
    assert told.status == 403
    assert b"night" not in told.content


@pytest.mark.parametrize(
    "cookie",
    [
        "",
        "evocity-{port}=",
        "evocity-{port}=guessed",
        "evocity-{port}={token}",
        "evocity-1={secret}",
        "evocity-{port}={secret}x",
        "evocity-{port}=guessed; evocity-{port}={secret}x",
        "evocity-{port}=é",
        "=;=;,",
    ],
)
@pytest.mark.parametrize(
    "path", ["/", "/api/0/births", "/api/0/picks", "/api/modeller", "/page/studio.js"]
)
def test_without_the_cookie_nothing_is_told(attacked, cookie, path):
    secret = attacked.cookie.partition("=")[2]
    token = attacked.server.url.partition("token=")[2]
    given = cookie.format(port=attacked.server.port, secret=secret, token=token)
    told = attacked.ask("GET", path, [("Cookie", given.encode("latin-1"))])
    assert told.status == 403
    assert "set-cookie" not in told.headers


@pytest.mark.parametrize(
    "path",
    [
        "/?token=",
        "/?token=guessed",
        "/?token=%00",
        "/?token=%C3%A9",
        "/?token={token}x",
        "/?token={short}",
        "/?token=guessed&token={token}",
        "/?Token={token}",
        "/api/0/births?token={token}",
    ],
)
def test_another_token_opens_nothing(attacked, path):
    token = attacked.server.url.partition("token=")[2]
    path = path.format(token=token, short=token[:-1])
    told = attacked.ask("GET", path, [("Cookie", "")])
    assert told.status == 403
    assert "set-cookie" not in told.headers


def test_a_token_changes_nothing(attacked):
    path = attacked.server.url.removeprefix(attacked.origin)
    told = attacked.ask("POST", path, [JSON, HEADER, ("Cookie", "")], PICK)
    assert told.status == 403
    assert "set-cookie" not in told.headers


@pytest.mark.parametrize(
    "path",
    [
        "/../secret.txt",
        "/page/../../secret.txt",
        "/page/..%2f..%2fsecret.txt",
        "/page/%2e%2e/%2e%2e/secret.txt",
        "/page/%252e%252e/secret.txt",
        "/page/..\\..\\secret.txt",
        "/page//etc/passwd",
        "//evil.example/",
        "/page/studio.js/",
        "/page/studio.js%00.html",
        "/page/Studio.js",
        "/%73tudio/studio.js",
        "/page/server.py",
        "/page/index.html",
        "/page/table.py",
        "/api",
        "/api/",
        "/api/births",
        "/api/-1/births",
        "/api/0/0/births",
        "/api/%30/births",
        "/api/0/births/",
        "/api/0/%62irths",
        "/api/0/births;x=1",
        "/.git/config",
        "/runs/night/provenance.json",
        "/provenance.json",
        "/favicon.ico",
        "http://evil.example/",
        "*",
    ],
)
def test_what_is_no_address_of_the_table_is_nothing(attacked, path):
    told = attacked.ask("GET", path)
    assert told.status in (400, 404)
    assert b"secret" not in told.content
    assert b"root:" not in told.content


@pytest.mark.parametrize(
    ("method", "path", "status"),
    [
        ("PUT", "/api/0/pick", 405),
        ("DELETE", "/api/0/picks", 405),
        ("PATCH", "/", 405),
        ("OPTIONS", "/api/0/pick", 405),
        ("TRACE", "/", 405),
        ("CONNECT", "/", 405),
        ("PROPFIND", "/", 405),
        ("GET", "/api/0/pick", 405),
        ("GET", "/api/0/zip", 405),
        ("HEAD", "/api/0/steer", 405),
        ("POST", "/api/0/births", 405),
        ("POST", "/", 405),
        ("GET", "/api/desk-file", 405),
        ("PUT", "/api/desk-file", 405),
        ("GET", "/api/desk-begin", 405),
        ("GET", "/api/modeller-use", 405),
        ("POST", "/api/modeller", 405),
        ("GET", "/api/0/resume", 405),
        ("POST", "/api/desk", 405),
    ],
)
def test_another_method_is_refused(attacked, method, path, status):
    given = ([JSON, HEADER], PICK) if method == "POST" else ()
    assert attacked.ask(method, path, *given).status == status


@pytest.mark.parametrize(
    ("headers", "body", "status"),
    [
        ([JSON], PICK, 403),
        ([JSON, (HEADER[0], "other")], PICK, 403),
        ([HEADER], PICK, 415),
        ([HEADER, ("Content-Type", "text/plain")], PICK, 415),
        ([HEADER, ("Content-Type", "application/x-www-form-urlencoded")], b"change=pick", 415),
        ([HEADER, ("Content-Type", "multipart/form-data; boundary=x")], b"--x--", 415),
        ([HEADER, ("Content-Type", "application/jsonp")], PICK, 415),
        ([HEADER, JSON], b" " * (MOST_BODY + 1), 413),
        ([HEADER, JSON, ("Content-Length", "99999999999999")], b"{}", 413),
        ([HEADER, JSON], b"", 400),
        ([HEADER, JSON], b"{", 400),
        ([HEADER, JSON], b"[" * 100_000, 400),
        ([HEADER, JSON], b'{"change": "pick", "ids": ["../../secret.txt"]}', 400),
        ([HEADER, JSON], b'{"change": "pick", "ids": [1.5]}', 400),
        ([HEADER, JSON], b'{"change": "pick", "ids": [true]}', 400),
        ([HEADER, JSON], b'{"change": "pick", "ids": [-1]}', 400),
        ([HEADER, JSON], b'{"change": "pick", "ids": [1e400]}', 400),
        ([HEADER, JSON], b'{"change": "pick", "ids": [99999999999999999999999]}', 400),
        ([HEADER, JSON], b'{"change": "pick", "ids": [3], "path": "/tmp/x"}', 400),
        ([HEADER, JSON], b'{"change": "write", "ids": [3]}', 400),
        ([HEADER, JSON], b'{"change": "pick", "ids": [99999]}', 409),
        ([HEADER, JSON], b'{"change": "note", "ids": [3], "note": "' + b"x" * 2001 + b'"}', 400),
        ([HEADER, JSON], b"\xff\xfe{}", 400),
        ([HEADER, JSON], b"null", 400),
    ],
    ids=range(24),
)
def test_changes_are_json_of_known_form_or_nothing(attacked, headers, body, status):
    assert attacked.ask("POST", "/api/0/pick", headers, body).status == status
    assert attacked.get("/api/0/picks").json["picks"] == []


@pytest.mark.parametrize(
    ("body", "status"),
    [
        ({"by": "looks"}, 400),
        ({"by": "../looks", "ids": [3]}, 400),
        ({"by": "looks", "ids": []}, 400),
        ({"by": "looks", "ids": ["3"]}, 400),
        ({"by": "scores", "ids": [3], "to": -1}, 400),
        ({"by": "scores", "ids": [3], "to": 99_999}, 409),
        ({"by": "kin", "ids": [99_999]}, 409),
        ({"by": "kin", "ids": list(range(401))}, 409),
        ({"by": "scores", "ids": list(range(401))}, 409),
    ],
)
def test_births_are_compared_by_number_and_not_too_many(attacked, body, status):
    assert attacked.post("/api/0/compare", body).status == status


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ([FILE], 403),
        ([FILE, (HEADER[0], "other")], 403),
        ([HEADER], 415),
        ([HEADER, JSON], 415),
        ([HEADER, ("Content-Type", "multipart/form-data; boundary=x")], 415),
        ([HEADER, FILE, ("Content-Type", "text/plain")], 415),
        ([HEADER, FILE, ("Content-Length", str(MOST_FILE + 1))], 413),
        ([HEADER, FILE, ("Content-Length", "-1")], (400, 413)),
        ([HEADER, FILE, ("Content-Length", "9" * 20)], (400, 413)),
        ([HEADER, FILE, ("Origin", "http://evil.example")], 403),
        ([HEADER, FILE, ("Origin", "null")], 403),
        ([HEADER, FILE, ("Sec-Fetch-Site", "cross-site")], 403),
        ([HEADER, FILE, ("Cookie", "")], 403),
    ],
    ids=range(13),
)
def test_a_file_is_taken_from_the_page_alone(attacked, headers, status):
    told = attacked.ask("POST", f"{ADDRESS}?name=a.geojson", headers, b"{}")
    assert told.status in (status if isinstance(status, tuple) else (status,))
    assert attacked.get("/api/desk").json["maps"][-1]["own"] is False


@pytest.mark.parametrize(
    ("path", "status"),
    [
        (ADDRESS, 400),
        (f"{ADDRESS}?name=", 400),
        (f"{ADDRESS}?name={'a' * 3000}.geojson", 400),
        (f"{ADDRESS}?name={'a' * 5000}.geojson", 414),
        (f"{ADDRESS}?name=..%2F..%2Fsecret.txt", 409),
        (f"{ADDRESS}?area=1", 400),
        (f"{ADDRESS}?area=1&name=..%2F..%2Fsecret.txt", 409),
        (f"{ADDRESS}/secret.geojson?name=a.geojson", 415),
        ("/api/0/desk-file?name=a.geojson", 415),
        ("/api/desk-change?name=a.geojson", 415),
    ],
)
def test_a_file_has_a_name_of_a_map_and_one_address(attacked, path, status):
    assert attacked.ask("POST", path, [HEADER, FILE], b"{}").status == status
    assert attacked.get("/api/desk").json["maps"][-1]["own"] is False


@pytest.mark.parametrize(
    ("name", "body"),
    [
        ("desk-begin", {"given": True, "recipe": "/tmp/x.toml"}),
        ("desk-begin", {"given": "/tmp/x.toml"}),
        ("desk-calibrate", {"file": "/tmp/own.py"}),
        ("desk-drop", {"map": "../../secret.txt"}),
        ("desk-drop", {"map": 0}),
        ("desk-end", {"map": -1}),
        ("0/stop-run", {"run": "/tmp"}),
        ("0/resume", {"generations": 3, "trust": True}),
        ("0/resume", {"generations": "3 --trust"}),
        ("0/resume", {"recipe": "/tmp/x.toml"}),
        ("1/resume", {}),
    ],
)
def test_nothing_is_begun_by_a_word_of_a_page(attacked, name, body):
    assert attacked.post(f"/api/{name}", body).status == 400
    assert attacked.get("/api/desk").json["started"] == []


@pytest.mark.parametrize("name", ["desk-picture", "desk-overview"])
@pytest.mark.parametrize("query", ["", "?map=..%2Fsecret", "?map=-1", "?map=99"])
def test_pictures_of_maps_are_asked_for_by_number(attacked, name, query):
    assert attacked.get(f"/api/{name}{query}").status == 400


#: What the page asks for when something is drawn, and what it draws.
DRAWN = {"operators": ["pavement_fusion"], "parents": [3, 20], "count": 1, "board": True}
CELLS = {"cell": 4, "marked": "1" + "0" * 255}


@pytest.mark.parametrize(
    ("body", "status"),
    [
        ({"drawing": {"locked": CELLS | {"cell": 0}}}, 400),
        ({"drawing": {"locked": CELLS | {"cell": 2**15}}}, 400),
        ({"drawing": {"locked": CELLS | {"cell": 4.0}}}, 400),
        ({"drawing": {"locked": CELLS | {"cell": "4"}}}, 400),
        ({"drawing": {"locked": CELLS | {"marked": ""}}}, 400),
        ({"drawing": {"locked": CELLS | {"marked": "1" * 4097}}}, 400),
        ({"drawing": {"locked": CELLS | {"marked": "2" * 256}}}, 400),
        ({"drawing": {"locked": CELLS | {"marked": "0" * 255 + "\n"}}}, 400),
        ({"drawing": {"within": CELLS | {"marked": "<script>"}}}, 400),
        ({"drawing": {"within": CELLS | {"marked": "\u0661" * 256}}}, 400),
        ({"drawing": {"within": CELLS | {"path": "../../secret.txt"}}}, 400),
        ({"drawing": {"within": CELLS["marked"]}}, 400),
        ({"drawing": {"within": [CELLS]}}, 400),
        ({"drawing": {"file": "secret.npy"}}, 400),
        ({"drawing": {"locked": CELLS | {"marked": "1" * 255}}}, 409),
        ({"drawing": {"within": CELLS | {"cell": 1}}}, 409),
        ({"drawing": {"locked": CELLS | {"marked": "1" * 256}}}, 409),
        ({"board": 1}, 400),
        ({"operators": ["os.system"]}, 409),
        ({"operators": ["<script>alert(1)</script>"]}, 409),
        ({"operators": ["__init__"]}, 409),
        ({"parameters": {"places": [["../secret.txt", 0]]}}, 409),
        ({"parameters": {"places": [[1e308, -1e308]]}}, 409),
        ({"parameters": {"places": [[0, 0]] * 200_000}}, 413),
        ({"parameters": {"places": "[[0, 0]]"}}, 409),
        ({"parameters": {"positions": [[-1, 2**62]]}}, 409),
        ({"parameters": {"fill": [0.5] * 60_000}}, 409),
        ({"parameters": {"__class__": "Condensation"}}, 409),
        ({"parameters": {f"p{n}": 1 for n in range(51)}}, 400),
        ({"operators": ["lambda_field"], "parameters": {"side": 8, "values": [2] * 64}}, 409),
        ({"operators": ["lambda_field"], "parameters": {"side": 10**9, "values": []}}, 409),
        ({"operators": ["interpolation"], "parameters": {"share": ["1"]}}, 409),
        ({"parents": [3, 99_999]}, 409),
        ({"parents": [3, -20]}, 400),
        ({"parents": [3, 1e2]}, 400),
        ({"seed": 2**63}, 400),
        ({"count": 10**6}, 400),
    ],
    ids=range(37),
)
def test_what_is_drawn_is_of_known_form_or_nothing(attacked, body, status):
    told = attacked.post("/api/0/breed", DRAWN | body)
    assert told.status == status
    if status != 413:
        assert set(told.json["error"]) == {"found", "expected", "remedy"}
        assert told.headers["content-type"] == "application/json"  # never as a page
    brood = attacked.get("/api/0/brood?board=1").json
    assert (brood["brood"], brood["busy"]) == (0, False)


@pytest.mark.parametrize(
    "number", [b"NaN", b"Infinity", b"-Infinity", b"1e999", b"0x10", b"01", b"1_000", b"1.", b"+1"]
)
@pytest.mark.parametrize("place", [b'"seed": %s', b'"parameters": {"places": [[%s, 0]]}'])
def test_what_is_no_number_is_not_drawn(attacked, place, number):
    body = json.dumps(DRAWN).encode()[:-1] + b", " + place % number + b"}"
    told = attacked.ask("POST", "/api/0/breed", [HEADER, JSON], body)
    assert told.status in (400, 409)
    assert attacked.get("/api/0/brood?board=1").json["brood"] == 0


@pytest.mark.parametrize(
    ("path", "body", "status"),
    [
        ("/api/1/breed", DRAWN, 400),
        ("/api/1/keep", {"brood": 1, "children": [0], "board": True}, 400),
        ("/api/0/keep", {"brood": 1, "children": [0], "board": True}, 409),
        ("/api/0/keep", {"brood": 0, "children": [0], "board": True}, 400),
        ("/api/0/keep", {"brood": 1, "children": ["../x"], "board": True}, 400),
        ("/api/0/keep", {"brood": 1, "children": [0], "board": True, "folder": "/tmp"}, 400),
        ("/api/0/ready", {"parents": [3, 20], "board": "yes"}, 400),
        ("/api/0/ready", {"parents": list(range(17)), "board": True}, 400),
    ],
)
def test_the_board_of_another_run_or_another_brood_is_nothing(attacked, path, body, status):
    assert attacked.post(path, body).status == status


def test_what_is_beside_and_is_no_birth_is_told(attacked):
    for question in (
        "solids?id=99999",
        "difference?id=3&beside=99999",
        "buildings?id=99999&of=area",
        "picture?id=3&kind=map&beside=99999",
        "calls?id=3&count=ranges&beside=99999",
        'filtered?request={"id":99999}',
        'filtered?request={"id":3,"beside":99999,"share":0.5}',
        'field?request={"ids":[99999],"place":0,"measure":"mean"}',
        'grown?request={"id":3}',
    ):
        told = attacked.get(f"/api/0/{question}")
        assert told.status == 409
        assert set(told.json["error"]) == {"found", "expected", "remedy"}


def test_a_body_without_a_length_is_counted(attacked):
    chunk = b"10000\r\n" + b" " * 65536 + b"\r\n"
    body = chunk * 17 + b"0\r\n\r\n"
    headers = [HEADER, JSON, ("Transfer-Encoding", "chunked")]
    assert attacked.ask("POST", "/api/0/pick", headers, body).status == 413


def test_a_question_with_a_body_is_refused(attacked):
    assert attacked.ask("GET", "/api/0/births", body=b"{}").status == 400


@pytest.mark.parametrize(
    "question",
    [
        "/api/0/one?id=../3",
        "/api/0/one?id=",
        "/api/0/one",
        "/api/0/one?id=-1",
        "/api/0/one?id=1.5",
        "/api/0/one?id=1e3",
        "/api/0/one?id=%D9%A3",
        "/api/0/one?id=99999999999999999999",
        "/api/0/picture?id=3&kind=../map",
        "/api/0/picture?id=3",
        "/api/0/part?name=__dict__",
        "/api/0/part?name=../keep",
        "/api/0/part",
        "/api/0/tiles?ids=&side=96",
        "/api/0/tiles?ids=1,,2&side=96",
        "/api/0/tiles?ids=../1&side=96",
        "/api/0/tiles?ids=1&side=100000",
        "/api/0/tiles?ids=1&side=97",
        "/api/0/tiles?ids=" + ",".join(["1"] * (MOST + 1)) + "&side=96",
        "/api/0/changes?after=nan",
        "/api/0/changes",
        "/api/0/heights?id=x",
        "/api/0/calls?id=3&count=__init__",
        "/api/0/calls?id=3",
        "/api/0/calls?id=3&count=pixels&beside=../3",
        "/api/0/picture?id=3&kind=map&beside=-2",
        "/api/0/solids",
        "/api/0/solids?id=3.obj",
        "/api/0/solids?id=3&library=../objects",
        "/api/0/filtered",
        '/api/0/filtered?request={"id":3,"zoom":1e9}',
        '/api/0/field?request={"ids":[3],"place":0,"measure":"city"}',
        '/api/0/grown?request={"id":3,"times":1000000}',
        "/api/0/difference?id=3",
        "/api/0/difference?id=3&beside=",
        "/api/0/difference?id=3&beside=1e3",
        "/api/0/difference?id=3&beside=99999999999999999999",
        "/api/0/buildings?id=3",
        "/api/0/buildings?id=3&of=__class__",
        "/api/0/buildings?id=3&of=<script>",
        "/api/0/buildings?id=3&of=area&beside=nan",
        "/api/0/board",
        "/api/0/board?ids=3",
        "/api/0/board?ids=3,3",
        "/api/0/board?ids=3,20,5",
        "/api/0/board?ids=3,../20",
        "/api/0/brood?board=2",
        "/api/0/brood?board=true",
        "/api/0/brood-picture?board=1&brood=-1&id=0",
        "/api/0/brood-tiles?board=1&brood=0&ids=x",
        "/api/1/births",
        "/api/x/births",
        "/api/99999999999999999999/births",
        "/api/0.0/births",
    ],
)
def test_questions_are_numbers(attacked, question):
    told = attacked.get(question)
    assert told.status == 400
    assert set(told.json["error"]) == {"found", "expected", "remedy"}


def test_long_lines_and_headers_are_refused(attacked):
    assert attacked.get("/api/0/one?id=" + "0" * 5000).status == 414
    told = attacked.ask("GET", "/api/0/picks", [("X-Long", "x" * 100_000)])
    assert told.status in (400, 431)


def test_no_websocket_opens(attacked):
    headers = [
        ("Connection", "Upgrade"),
        ("Upgrade", "websocket"),
        ("Sec-WebSocket-Version", "13"),
        ("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="),
    ]
    told = attacked.ask("GET", "/api/0/picks", headers)
    assert told.status != 101


def test_a_second_request_cannot_hide_in_a_body(attacked):
    hidden = f"POST /api/0/pick HTTP/1.1\r\nHost: {own(attacked)}\r\n\r\n".encode()
    with socket.create_connection((HOST, attacked.server.port), 20) as raw:
        raw.sendall(
            f"POST /api/0/pick HTTP/1.1\r\nHost: evil.example\r\nContent-Length: {len(hidden)}\r\n"
            f"Transfer-Encoding: chunked\r\n\r\n".encode()
            + hidden
        )
        raw.settimeout(20)
        told = b""
        while part := raw.recv(65536):
            told += part
    assert told.startswith((b"HTTP/1.1 400", b"HTTP/1.1 421"))
    assert told.count(b"HTTP/1.1 ") == 1


def test_only_this_machine_can_connect(attacked):
    assert attacked.server._socket.getsockname()[0] == "127.0.0.1"


@pytest.mark.parametrize(
    "path",
    ["/", "/page/studio.js", "/api/0/picks", "/api/0/one?id=3", "/nothing", "/api/0/one?id=x"],
)
def test_every_answer_says_what_a_browser_may_do_with_it(attacked, path):
    said = attacked.get(path).headers
    assert said["content-security-policy"] == POLICY
    assert "unsafe" not in POLICY
    assert "frame-ancestors 'none'" in POLICY
    assert said["x-content-type-options"] == "nosniff"
    assert said["referrer-policy"] == "no-referrer"
    assert said["cross-origin-resource-policy"] == "same-origin"
    assert said["cross-origin-opener-policy"] == "same-origin"
    assert said["cache-control"] == "no-store"
    assert not {"server", "access-control-allow-origin"} & set(said)


def test_the_cookie_is_for_this_server_alone(attacked):
    fresh = Client(attacked.server)
    told = fresh.open()
    assert told.status == 200
    name, _, rest = told.headers["set-cookie"].partition("=")
    assert name == f"evocity-{attacked.server.port}"
    assert {part.strip() for part in rest.split(";")[1:]} == {
        "HttpOnly",
        "SameSite=Strict",
        "Path=/",
    }
    token = attacked.server.url.partition("token=")[2]
    assert token not in rest
    assert len(token) >= 43  # 256 bits
    assert len(rest.partition(";")[0]) >= 43
