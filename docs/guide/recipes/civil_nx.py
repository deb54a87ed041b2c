import json
from urllib.request import Request, urlopen

from skthermo.fem import CallableModel


def call(method, path, body=None):
    headers = {"MAPI-Key": key, "Content-Type": "application/json"}
    with urlopen(Request(f"{address}/{path}", json.dumps(body).encode(), headers, method=method)) as answer:
        return json.load(answer)


built = call("GET", "db/MATL")["MATL"]  # materials as built, by number
materials = {"E_deck": "1", "E_arch": "2"}


def frequencies(theta):
    for number, multiplier in zip(materials.values(), theta):
        changed = json.loads(json.dumps(built[number]))
        changed["PARAM"][0]["ELAST"] *= float(multiplier)
        call("PUT", "db/MATL", {"Assign": {number: changed}})
    call("POST", "doc/ANAL", {"Argument": {}})
    table = {"TABLE_NAME": "modes", "TABLE_TYPE": "EIGENVALUEMODE"}
    answer = call("POST", "post/TABLE", {"Argument": table})["modes"]
    modes = next(part["EIGENVALUE ANALYSIS"] for part in answer["SUB_TABLES"] if "EIGENVALUE ANALYSIS" in part)
    column = modes["HEAD"].index("Frequency(cycle/sec)")
    return [float(row[column]) for row in modes["DATA"]][:4]


model = CallableModel(frequencies, list(materials), 4, cache="bridge.solved")
