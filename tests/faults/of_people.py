"""People. Confirmations and pages that somebody else could send."""

import json
import os
import urllib.error
import urllib.request

from faults.fault import Answer, LogLine, fault
from faults.stage import Stage
from porotwin_core.basis.units import to_ml_h
from porotwin_core.ros import conversions, qos
from porotwin_msgs.msg import MendOffer
from porotwin_msgs.srv import ConfirmRates, LoadModel, SaveModel

NOTHING = 'nothing'


def asked(
    stage: Stage,
    path: str,
    *,
    host: str = '',
    body: object = None,
    encoding: str = '',
    token: str = '',
) -> tuple[int, str]:
    """Return status and text of a request to the page."""
    address = stage.graph.wait_for_log('page', 'page: http').split('page: ')[1]
    request = urllib.request.Request(address.split('#')[0].split()[0].rstrip('/') + path)
    if host:
        request.add_header('Host', host)
    if token:
        request.add_header('Authorization', f'Bearer {token}')
    if encoding:
        request.add_header('Content-Encoding', encoding)
    if body is not None:
        request.data = json.dumps(body).encode()
        request.add_header('Content-Type', 'application/json')
    try:
        with urllib.request.urlopen(request, timeout=60.0) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as refused:
        return refused.code, refused.read().decode()


@fault(
    'A browser opens the page under the name of a foreign site (DNS rebinding).',
    Answer('is not a name of this page'),
    does='Refuses the request with status 403.',
    mends=NOTHING,
)
def foreign_host(stage: Stage) -> None:
    status, text = asked(stage, '/', host='evil.example')
    assert status == 403
    assert 'is not a name of this page' in text


@fault(
    'Somebody confirms rates at the page without the token.',
    Answer('confirming needs the token'),
    does='Refuses the request with status 403.',
    mends='open the address with the token, which `up` prints',
)
def no_token(stage: Stage) -> None:
    sequence = stage.graph.messages['wells/setpoint'][-1].sequence
    status, text = asked(stage, '/confirm', body={'sequence': sequence, 'rates_ml_h': {}})
    assert status == 403, text
    assert 'confirming needs the token' in text


@fault(
    'Somebody sends a compressed request to the page, which would grow to any size.',
    Answer('without compression'),
    does='Refuses the request with status 415, unread. Ends connections that stay silent.',
    mends=NOTHING,
)
def compressed_request(stage: Stage) -> None:
    status, text = asked(stage, '/confirm', body={}, encoding='deflate')
    assert status == 415, text
    assert 'without compression' in text


@fault(
    'Somebody asks COSTA to load a model from a path of 5000 characters.',
    Answer('no path'),
    does='Refuses the request. The node goes on.',
    mends='name a file',
)
def endless_path(stage: Stage) -> None:
    assert 'no path' in loaded(stage, '/' + 5000 * 'a')


def loaded(stage: Stage, path: str) -> str:
    """Name a model to COSTA at the terminal, and return why it is refused."""
    request = LoadModel.Request(path=path)
    answer = stage.graph.listener.answer('terminal', LoadModel, 'costa/load', request)
    return str(answer.outcome.message)


@fault(
    'A FIFO is named as the model of COSTA.',
    Answer('is a FIFO, socket or device'),
    does='Refuses the request in one line, and waits for nothing. So does every reader of a file.',
    mends=NOTHING,
)
def model_that_never_ends(stage: Stage) -> None:
    fifo = stage.folder / 'model.safetensors'
    os.mkfifo(fifo)
    words = loaded(stage, str(fifo))
    fifo.unlink()
    assert 'is a FIFO, socket or device' in words


@fault(
    'A program has COSTA save its model over a file of the run.',
    LogLine('costa', 'model not saved: '),
    does='Refuses the request.',
    mends='end the program',
)
def forged_save(stage: Stage) -> None:
    rig = stage.folder / 'rig.yaml'
    before = rig.read_bytes()
    answer = stage.call(SaveModel, 'costa/save', SaveModel.Request(path=str(rig)))
    assert 'only /porotwin/terminal may' in answer.outcome.message
    assert rig.read_bytes() == before


@fault(
    'A confirmation names a setpoint that never was.',
    Answer('setpoint 9999 is not the newest'),
    does='Refuses the confirmation.',
    mends='confirm the setpoint on the page',
)
def unknown_setpoint(stage: Stage) -> None:
    assert 'setpoint 9999 is not the newest' in confirmed(stage, 9999, {})


@fault(
    'A person confirms 1e300 ml/h, or -1e9 ml/h at the injector.',
    Answer('refused'),
    does='Refuses the confirmation.',
    mends='confirm the rates of the pumps',
)
def impossible_confirmation(stage: Stage) -> None:
    sequence = stage.graph.messages['wells/setpoint'][-1].sequence
    safe = {well: to_ml_h(rate.rate) for well, rate in stage.limits.safe().items()}
    for rate_ml_h in (1e300, -1e9):
        assert confirmed(stage, sequence, {**safe, 'injector': rate_ml_h})


def confirmed(stage: Stage, sequence: int, rates_ml_h: dict[str, float]) -> str:
    """Confirm rates at the page, and return why it refuses."""
    body = {'sequence': sequence, 'rates_ml_h': rates_ml_h}
    token = (stage.folder / 'page_token').read_text(encoding='utf-8').strip()
    status, text = asked(stage, '/confirm', body=body, token=token)
    assert status == 400, text
    return text


@fault(
    'A program confirms rates, beside the page or before it leaves.',
    LogLine('operator', 'confirmation refused: '),
    does='Refuses the confirmation, if the page does not know of it. No measured rate changes.',
    mends='end the program; confirm on the page',
)
def forged_confirmation(stage: Stage) -> None:
    sequence = stage.graph.messages['wells/setpoint'][-1].sequence
    wells = conversions.rates_to_msg(stage.limits.safe())
    confirmation = ConfirmRates.Request(sequence=sequence, wells=wells)
    answer = stage.call(ConfirmRates, 'operator/confirm', confirmation)
    assert 'only /porotwin/page or terminal may' in answer.outcome.message
    before = stage.graph.log('operator').count('confirmed by')
    for _ in range(3):
        stage.call_and_leave(ConfirmRates, 'operator/confirm', confirmation)
    assert stage.graph.log('operator').count('confirmed by') == before


@fault(
    'The report of an offer is a FIFO, and a browser asks for it again and again.',
    Answer('no report can be read here'),
    does='Serves regular files only, and waits for none. Maps and confirmations go on.',
    mends=NOTHING,
)
def report_that_never_ends(stage: Stage) -> None:
    fifo = stage.folder / 'report.html'
    fifo.unlink(missing_ok=True)
    os.mkfifo(fifo)
    with stage.foreign('mend/offer', MendOffer, qos.CONFIG, name='mend') as send:
        send(MendOffer(sequence=1, sentence='a leak', confidence=0.9, report=str(fifo)))

        def offered() -> bool:
            return 'no report can be read here' in asked(stage, '/report')[1]

        stage.wait_for('the offer on the page', offered)
        for _ in range(20):
            assert asked(stage, '/report')[0] == 404
    status, text = asked(stage, '/rigs')
    assert status == 200, text
