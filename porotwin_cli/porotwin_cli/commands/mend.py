"""./porotwin mend: the offers of the running twin to mend its model."""

from enum import StrEnum
from typing import Annotated

import typer

from porotwin_cli.options.rig_choice import Domain, Namespace
from porotwin_cli.terminal import Json, print_json
from porotwin_core.basis.errors import InputError
from porotwin_core.ros.foreign_words import in_short, said
from porotwin_core.ros.ros_environment import enter_domain, namespace_of
from porotwin_hub.launching.graph import NAMESPACE
from porotwin_page.mend_answer import LARGEST_NUMBER


class Answer(StrEnum):
    """An answer to the newest offer, or none."""

    SHOW = 'show'
    ACCEPT = 'accept'
    REFUSE = 'refuse'


def command(
    answer: Annotated[
        Answer, typer.Argument(help='show, accept or refuse the newest offer.')
    ] = Answer.SHOW,
    offer: Annotated[
        int | None, typer.Option(help='Number of the offer. Default: the newest.', min=1)
    ] = None,
    namespace: Namespace = NAMESPACE,
    domain: Domain = None,
    as_json: Json = False,
) -> None:
    """Show or answer the offer of the running twin to mend its model.

    With ./porotwin up --mend ask, a diagnosis runs beside the twin and offers a sure cause. An
    accepted effect acts in forecasts and plans at once. The twin removes the effect again if it
    makes the next forecasts worse.

    Example: ./porotwin mend accept
    """
    from porotwin_cli.running.live_mend import MendDesk

    if offer is not None and offer > LARGEST_NUMBER:
        raise InputError(
            f'offer {offer}: no offer has this number; ./porotwin mend shows the newest one'
        )
    enter_domain(domain)
    with MendDesk(namespace=namespace_of(namespace)) as desk:
        desk.wait_for_node()
        shown = desk.offer()
        number = offer or (shown.sequence if shown is not None else 0)
        if answer is not Answer.SHOW:
            if number == 0:
                raise InputError('nothing has been offered yet; wait for an offer')
            desk.answer(number, accept=answer is Answer.ACCEPT)
    if as_json:
        newest = vars(shown) if shown is not None else None
        print_json({'offer': newest, 'answer': str(answer)})
    elif answer is not Answer.SHOW:
        print(
            f'offer {number}: accepted' if answer is Answer.ACCEPT else f'offer {number}: refused'
        )
    elif shown is None:
        print('nothing has been offered yet')
    else:
        print(f'offer {shown.sequence}, {shown.state}: {said("mend", shown.sentence)}')
        print(f'report: {in_short(shown.report)}')
