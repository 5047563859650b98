"""The measure ``bad`` of ninety kinds, as source: the name of its genome's city says what it does.
``calm`` ones check whether another left something behind in their process."""

SOURCE = r'''
import atexit, builtins, ctypes, decimal, faulthandler, gc, json, locale, math, multiprocessing, os
import pickle, random, resource, shutil, signal, struct, subprocess, sys, tempfile, threading, time
import warnings
import numpy as np
import evocity

NOTES = NOTES_FOLDER
FOLDER, PATH = os.getcwd(), list(sys.path)


def note(pid, kind):
    with open(f"{NOTES}/{kind}-{pid}", "w"):
        pass


def value(city):
    return float(city.heights.mean())


def at_rest():
    """Raises where the process is not what it was."""
    assert os.getcwd() == FOLDER, os.getcwd()
    assert "EVIL" not in os.environ and "HOME_BEFORE" not in os.environ
    assert sys.path == PATH
    assert signal.getsignal(signal.SIGALRM) is signal.SIG_DFL
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    assert np.geterr()["divide"] == "warn"
    assert "json" in sys.modules and "numpy" in sys.modules
    assert gc.isenabled()
    assert sys.getrecursionlimit() == 1000
    assert ctypes.CDLL(None).fegetround() == 0
    assert float(np.float64(5e-324) * np.float64(1)) == 5e-324
    assert sum([1, 2]) == 3 and isinstance(1, int) and open is not None
    mask = os.umask(0o022)
    assert mask == 0o022, mask
    print("a calm birth")
    sys.stdout.flush()
    os.fstat(0), os.fstat(1), os.fstat(2)
    with tempfile.TemporaryFile() as file:
        assert file.fileno() > 2
        file.write(b"more than four bytes")
    warnings.warn("calm")
    try:
        os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
    except ChildProcessError:
        return
    raise AssertionError("children of another birth")


class BadText(BaseException):
    def __str__(self):
        raise ValueError("no text")


class BadFloat:
    def __float__(self):
        raise RuntimeError("no number")


class BadReal(float):
    def __float__(self):
        raise RuntimeError("no number")


class Unpicklable(Exception):
    def __reduce__(self):
        raise TypeError("not me")


def raises(): raise ValueError("a bad mood")
def nan(): return float("nan")
def infinite(): return float("inf")
def text(): return "text"
def nothing(): return None
def boolean(): return True
def imaginary(): return 1j
def array(): return np.zeros(3)
def generator(): return (one for one in (1.0, 2.0))
def bad_float(): return BadFloat()
def bad_real(): return BadReal(1.0)
def endless_number(): return 10 ** 5000
def leaves(): sys.exit(3)
def exits_0(): os._exit(0)
def exits_1(): os._exit(1)
def exits_255(): os._exit(255)
def crashes(): ctypes.string_at(0)
def aborts(): os.abort()
def kills_itself(): os.kill(os.getpid(), signal.SIGKILL)
def stops_itself(): os.kill(os.getpid(), signal.SIGSTOP)
def hangs(): time.sleep(1e6)
def hangs_in_c(): ctypes.PyDLL(None).sleep(1000)


def deaf_and_hangs():
    for one in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(one, signal.SIG_IGN)
    while True:
        pass


def closes_files():
    os.closerange(0, 10)


def closes_all_files():
    os.closerange(0, 1 << 16)


def starts_threads():
    for _ in range(20):
        threading.Thread(target=time.sleep, args=(1e6,), daemon=True).start()


def forks_and_returns():
    pid = os.fork()
    if pid == 0:
        return 1e6
    note(pid, "forked")
    os.waitpid(pid, 0) if random.random() < 0.5 else time.sleep(0.2)


def forks_and_raises():
    if os.fork() == 0:
        raise SystemExit


def forked_hangs():
    pid = os.fork()
    if pid == 0:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        while True:
            time.sleep(1)
    note(pid, "forked")


def starts_a_process():
    note(subprocess.Popen(["sleep", "1000"]).pid, "started")


def starts_a_leader():
    note(subprocess.Popen(["sleep", "1000"], start_new_session=True).pid, "leader")


def starts_a_daemon():
    if os.fork() == 0:
        os.setsid()
        if os.fork() == 0:
            note(os.getpid(), "daemon")
            time.sleep(1000)
        os._exit(0)
    while not any(name.startswith("daemon") for name in os.listdir(NOTES)):
        time.sleep(0.01)


def leader_and_hangs():
    starts_a_leader()
    starts_a_process()
    time.sleep(1e6)


def leader_and_exits():
    starts_a_leader()
    os._exit(7)


def shell_in_background():
    note(int(subprocess.check_output("sleep 1000 >/dev/null & echo $!", shell=True)), "shell")


def allocates(): return float(np.ones(30 * 10 ** 9 // 8).sum())
def allocates_bytes(): return float(len(bytearray(30 * 10 ** 9)))


def grows():
    kept = []
    while True:
        kept.append(bytes(10 ** 7))


def grows_shared():
    import mmap
    shared = mmap.mmap(-1, 2 * 10 ** 9)
    for at in range(0, 7 * 10 ** 8, 4096):
        shared[at] = 1
    time.sleep(1e6)


KEPT, CITY = [], []


def leaks():
    KEPT.append(np.ones(25 * 10 ** 6))


def prints():
    while True:
        print("again and again", "\x1b[31m")


def prints_much_and_ends():
    sys.stdout.write("y" * 10 ** 7)
    sys.stderr.write("y" * 10 ** 7)


def prints_in_c():
    libc, told = ctypes.CDLL(None), b"in C \x1b[2J" * 1000
    while True:
        libc.write(1, told, len(told))


def prints_holding_all():
    libc, told = ctypes.PyDLL(None), b"in C" * 1000
    for _ in range(5_000):
        libc.write(2, told, len(told))


def prints_from_a_child():
    note(subprocess.Popen(["yes"]).pid, "yes")


def moves(): os.chdir("/")


def moves_nowhere():
    place = tempfile.mkdtemp()
    os.chdir(place)
    os.rmdir(place)


def changes_environment():
    os.environ["EVIL"] = "1"
    os.environ.pop("PATH", None)


def seeds():
    random.seed(0)
    np.random.seed(0)


def forgets_modules():
    for name in list(sys.modules):
        if name.split(".")[0] in ("json", "numpy", "evocity", "multiprocessing", "encodings"):
            del sys.modules[name]


def changes_path(): sys.path.clear()
def recurses(): return recurses()


def recurses_deeper():
    sys.setrecursionlimit(10 ** 9)
    return recurses()


def interrupts(): raise KeyboardInterrupt
def bad_text(): raise BadText
def unpicklable(): raise Unpicklable("no")
def long_text(): raise ValueError("x" * 10 ** 7)
def control_text(): raise ValueError("\x1b[31mred\x00\x07\r\n\x9b2J \udc80")


def handles_signals():
    for one in (signal.SIGTERM, signal.SIGALRM, signal.SIGCHLD):
        signal.signal(one, lambda *_: os._exit(9))


def sets_an_alarm():
    signal.setitimer(signal.ITIMER_REAL, 0.05)


def blocks_signals(): signal.pthread_sigmask(signal.SIG_BLOCK, range(1, 32))


def closes_stdout():
    sys.stdout.close()
    sys.stderr.close()
    sys.__stdout__ and sys.__stdout__.close()


def replaces_stdout(): sys.stdout = sys.stderr = None
def swaps_stdout(): os.dup2(os.open("/dev/null", os.O_RDONLY), 1)
def will_dump(): faulthandler.dump_traceback_later(0.05, exit=True)


def uses_processes():
    with multiprocessing.get_context("fork").Pool(2) as workers:
        assert workers.map(abs, [-1, 2]) == [1, 2]


def leaves_a_process():
    process = multiprocessing.get_context("fork").Process(target=time.sleep, args=(1000,))
    process.start()
    note(process.pid, "multiprocessing")


def leaves_files():
    tempfile.mkdtemp(prefix="left-")
    with open(tempfile.mkstemp(prefix="left-")[1], "w") as file:
        file.write("left")
    multiprocessing.util.get_temp_dir()


def limits_itself():
    for one in (resource.RLIMIT_NOFILE, resource.RLIMIT_FSIZE):
        resource.setrlimit(one, (4, resource.getrlimit(one)[1]))


def raises_all_errors():
    np.seterr(all="raise")
    warnings.simplefilter("error")
    os.umask(0o777)
    gc.disable()
    sys.setrecursionlimit(100)


def kills_the_group(): os.killpg(os.getpgid(os.getppid()), signal.SIGKILL)
def ends_its_parent(): os.kill(os.getppid(), signal.SIGTERM)
def stops_its_parent(): os.kill(os.getppid(), signal.SIGSTOP)


def waits(): time.sleep(0.4)


# -- the floating-point environment, built-in functions, the interpreter

def rounds_up(): ctypes.CDLL(None).fesetround(0x800)
def rounds_to_zero(): ctypes.CDLL(None).fesetround(0xC00)


def flushes_to_zero():
    state = (ctypes.c_uint32 * 8)()  # of x86-64: the last word is MXCSR
    ctypes.CDLL(None).fegetenv(state)
    state[7] |= 0x8040
    ctypes.CDLL(None).fesetenv(state)


def traps_divisions(): ctypes.CDLL(None).feenableexcept(0x1D)
def replaces_sum(): builtins.sum = lambda *_: 7
def replaces_isinstance(): builtins.isinstance = lambda *_: True
def replaces_import(): builtins.__import__ = None
def replaces_all(): builtins.all = builtins.map = builtins.len = None


def changes_time_zone():
    os.environ["TZ"] = "Pacific/Apia"
    time.tzset()


def changes_locale(): locale.setlocale(locale.LC_ALL, "C.UTF-8")
def changes_decimals(): decimal.getcontext().prec = 2
def shows_no_digits(): np.set_printoptions(precision=0, threshold=1)
def switches_rarely(): sys.setswitchinterval(100)
def exits_later(): atexit.register(os._exit, 3)
def hooks_errors(): sys.excepthook = sys.unraisablehook = threading.excepthook = None
def removes_its_temporary_folder(): shutil.rmtree(tempfile.gettempdir())


def opens_files():
    KEPT.extend(open(os.devnull) for _ in range(50))


# -- evocity's own code, and that of NumPy: the canary notices

def replaces_evaluate():
    from dataclasses import replace
    from evocity.evaluation.evaluator import Evaluator
    whole = Evaluator.evaluate

    def evaluate(self, *given, **named):
        outcome = whole(self, *given, **named)
        return replace(outcome, values={name: one + 1 for name, one in outcome.values.items()})

    Evaluator.evaluate = evaluate


def replaces_a_measure():
    object.__setattr__(evocity.fitness.get("gsi"), "function", lambda city: 0.5)


def replaces_decoding():
    from evocity.coding import decoding_cache
    whole = decoding_cache.decode
    decoding_cache.decode = lambda genome: whole(genome.replace(beta=genome.beta + 1))


def replaces_a_view():
    evocity.CityMap.built = property(lambda city: city.heights > 5)


def replaces_rounding():
    whole = np.rint
    np.rint = lambda array, *more: whole(array, *more) + 1


def writes_the_map():
    CITY[0].heights.setflags(write=True)
    CITY[0].heights[:] = 0


def writes_a_view():
    CITY[0].built.setflags(write=True)
    CITY[0].built[:] = True


def breaks_the_decoder():
    from evocity.coding import decoding_cache
    decoding_cache.decode = None


def hangs_the_next():
    from evocity.coding import decoding_cache
    decoding_cache.decode = lambda genome: time.sleep(1e6)


def ends_the_next():
    from evocity.coding import decoding_cache
    decoding_cache.decode = lambda genome: os._exit(3)


# -- what a measure writes into its worker's connection

def sent(message):
    for name in os.listdir("/proc/self/fd"):
        place = f"/proc/self/fd/{name}"
        if int(name) >= 200 and os.path.exists(place) and "socket" in os.readlink(place):
            os.write(int(name), message)


class Touches:
    def __reduce__(self):
        return os.system, (f"touch {NOTES}/unpickled-1",)


def framed(message): return struct.pack("<Q", len(message)) + message
def sends_noise(): sent(random.Random(1).randbytes(10**5))
def sends_a_pickle(): sent(framed(pickle.dumps(Touches())))
def sends_a_great_length(): sent(struct.pack("<Q", 1 << 40))
def sends_no_document(): sent(framed(b"EVO1" + struct.pack("<Q", 2) + b"[]"))
def sends_a_part(): sent(struct.pack("<Q", 1 << 20) + b"a part")


def sends_another_answer():
    from evocity.evaluation.answers import Answer, write_answer
    from evocity.evaluation.evaluator import Outcome
    sent(write_answer(Answer(10**6, Outcome("ok", values={"bad": 1.0}), False, "")))


@evocity.fitness(goal="max")
def bad(city, genome):
    kind = genome.cities[0]
    note(os.getpid(), "worker")
    if kind.startswith("calm"):
        at_rest()
        return value(city) + int(kind[5:])
    before, CITY[:] = value(city), [city]
    told = globals()[kind]()
    own = kind in OWN_VALUES or type(told) in (float, BadReal)
    return told if own else before


OWN_VALUES = ("text", "nothing", "boolean", "imaginary", "array", "generator", "bad_float",
              "bad_real", "endless_number")
'''

#: How a birth of each kind ends; "changed": an error, since the canary differs after it.
ENDS = {
    "ok": (
        "closes_files starts_threads forks_and_returns forks_and_raises forked_hangs "
        "starts_a_process starts_a_leader starts_a_daemon shell_in_background leaks "
        "prints_much_and_ends prints_holding_all prints_from_a_child moves moves_nowhere "
        "changes_environment seeds forgets_modules changes_path handles_signals sets_an_alarm "
        "blocks_signals closes_stdout replaces_stdout swaps_stdout will_dump uses_processes "
        "leaves_a_process leaves_files limits_itself raises_all_errors rounds_up rounds_to_zero "
        "flushes_to_zero traps_divisions replaces_sum replaces_isinstance replaces_import "
        "changes_time_zone changes_locale changes_decimals shows_no_digits switches_rarely "
        "exits_later hooks_errors replaces_all removes_its_temporary_folder opens_files"
    ),
    "error": (
        "raises leaves recurses interrupts bad_text unpicklable long_text control_text bad_real "
        "endless_number"
    ),
    "changed": (
        "replaces_evaluate replaces_a_measure replaces_decoding replaces_a_view replaces_rounding "
        "writes_the_map writes_a_view breaks_the_decoder hangs_the_next ends_the_next"
    ),
    "invalid": ("nan infinite text nothing boolean imaginary array generator bad_float"),
    "timeout": (
        "stops_itself hangs hangs_in_c deaf_and_hangs leader_and_hangs prints prints_in_c "
        "sends_a_part"
    ),
    "died": (
        "exits_0 exits_1 exits_255 crashes aborts kills_itself closes_all_files leader_and_exits "
        "sends_noise sends_a_pickle sends_a_great_length sends_no_document sends_another_answer"
    ),
    "memory": "allocates allocates_bytes grows grows_shared recurses_deeper",
}
#: The status of each kind; those of "ok" have the value that they have without the bad deed.
KINDS = {
    name: "error" if status == "changed" else status
    for status, names in ENDS.items()
    for name in names.split()
}
CHANGING = ENDS["changed"].split()
#: One of each sort.
FEW = [
    "starts_a_leader",
    "leaks",
    "prints_much_and_ends",
    "moves",
    "changes_environment",
    "handles_signals",
    "uses_processes",
    "leaves_files",
    "raises_all_errors",
    "rounds_up",
    "replaces_sum",
    "replaces_evaluate",
    "hangs_the_next",
    "sends_a_pickle",
    "raises",
    "unpicklable",
    "nan",
    "hangs_in_c",
    "prints_in_c",
    "stops_itself",
    "exits_1",
    "crashes",
    "kills_itself",
    "closes_all_files",
    "allocates",
    "grows",
]
