"""The report that a physicist reads: pictures first, then the evidence, on one page."""

import base64
import html
import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from porotwin_diagnosis.candidates import CAMERA
from porotwin_diagnosis.search import score
from porotwin_diagnosis.verdict import NONE, UNEXPLAINED

if TYPE_CHECKING:
    from porotwin_diagnosis.diagnose import Diagnosis

SENTENCES = {
    'numerical_diffusion': 'the model itself smears: a sharper scheme closes the gap',
    'dispersion': 'the tracer spreads more than by molecular diffusion alone',
    'buoyancy': 'the tracer has another density than water',
    'viscosity': 'the tracer has another viscosity than water',
    'retardation': 'the tracer sorbs to the sand',
    'decay': 'the tracer fades or is lost',
    'dual_porosity': 'a part of the pore water does not move',
    'heterogeneity': 'a zone of the sand is more or less permeable than believed',
    'porosity': 'the porosity is not what is believed',
    'depth': 'the plates bulge',
    'rate': 'a pump does not deliver what it is told',
    'well_position': 'a well opens elsewhere than believed',
    'leak': 'water is lost or gained at an unknown place',
    'background_flow': 'water flows through the whole rig beside the wells',
    'saturation': 'the camera’s signal is not proportional to the concentration',
    'illumination': 'the light drifts or is uneven',
    'registration': 'the picture is shifted, turned or scaled against the rig',
    'clock': 'the clock of the photographs does not agree with that of the pumps',
}
CHECKS = {
    'dispersion': 'repeat at half the rates: dispersion goes with distance, diffusion with time',
    'buoyancy': 'stop all pumps: the plume goes on sinking or rising; weigh a flask of the stock',
    'viscosity': 'measure the stock in a capillary viscometer',
    'retardation': 'shake a batch of sand with stock and measure what stays dissolved',
    'decay': 'leave a closed bottle of stock in the same light and photograph it every hour',
    'dual_porosity': 'chase with water and watch the tail at the producer',
    'heterogeneity': 'look at the sand there; inject from a well close to it',
    'porosity': 'weigh the water that fills the rig',
    'depth': 'measure the gap between the plates in the middle with a feeler gauge',
    'rate': 'collect what the pump delivers in a measuring cylinder for ten minutes',
    'well_position': 'measure where the well opens',
    'leak': 'stop all pumps and watch the water table; dry the plates and look for drops',
    'background_flow': 'inject a drop of tracer with all pumps stopped and see where it drifts',
    'saturation': 'photograph three bottles of stock diluted to known concentrations',
    'illumination': 'photograph a grey card at the start and the end, left and right',
    'registration': 'photograph a scale in the rig and mark its corners again',
    'clock': 'photograph the clock of the pumps',
    'numerical_diffusion': 'run the model with the accurate setting',
}

STYLE = """
body{font:16px/1.5 system-ui,sans-serif;max-width:1080px;margin:2rem auto;padding:0 1rem;
color:#1c2430}
h1{font-size:1.6rem;margin-bottom:.2rem} h2{font-size:1.15rem;margin-top:2rem}
.verdict{font-size:1.2rem;background:#eef4fa;border-left:5px solid #2a6fb0;padding:.8rem 1rem}
img{width:100%;height:auto} figure{margin:1.2rem 0} figcaption{color:#52606d;font-size:.92rem}
table{border-collapse:collapse;width:100%;font-size:.92rem}
td,th{padding:.3rem .6rem;text-align:left;border-bottom:1px solid #dde3ea}
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums}
.bar{display:inline-block;height:.7rem;background:#2a6fb0;vertical-align:middle}
small{color:#52606d}
"""


def write_report(path: Path, result: 'Diagnosis') -> None:
    """Write the page for `result`; it needs nothing beside itself."""
    body = [
        f'<h1>Sim-to-real gap: {html.escape(result.recordings[0].rig.name)} rig</h1>',
        f'<small>{html.escape(", ".join(str(r.source) for r in result.recordings))}</small>',
        f'<p class="verdict">{_sentence(result)}</p>',
        _figure(
            _plumes(result),
            'The last map of the held-out part, and what the model makes of it '
            'from the pumps’ rates alone. Red: too much tracer, blue: too little.',
        ),
        _figure(
            _gap(result),
            'Left: where the gap arises, before the flow has carried it anywhere '
            '(one-step residuals in weak form). Right: free-running error over the held-out part.',
        ),
        '<h2>What was tried</h2>',
        _ranking(result),
        '<h2>When the gap arises</h2>',
        _phases(result),
        '<h2>How to check it in the laboratory</h2>',
        _checks(result),
        '<h2>Next experiment</h2>',
        _proposals(result),
        '<h2>What this recording could not have shown</h2>',
        _strengths(result),
        '<h2>How it was done</h2>',
        _method(result),
    ]
    page = (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>Diagnosis</title>'
        f'<style>{STYLE}</style></head><body>{"".join(body)}</body></html>'
    )
    path.write_text(page, encoding='utf-8')


def _sentence(result: 'Diagnosis') -> str:
    verdict, errors = result.verdict, result.summary['error']
    sure = f'confidence {verdict.confidence:.0%}'
    if verdict.name == NONE:
        return (
            f'<b>No gap.</b> The model explains the recording down to its noise '
            f'(error {errors["before"]:.1%}, noise floor {errors["noise_floor"]:.1%}; {sure}).'
        )
    if verdict.name == UNEXPLAINED:
        return (
            f'<b>Unexplained.</b> There is a gap of {errors["before"]:.1%}, and no effect of the '
            f'library accounts for it; the best leaves {errors["after"]:.1%} beside a noise floor '
            f'of {errors["noise_floor"]:.1%} ({sure}).'
        )
    others = [name for name in verdict.members if name != verdict.name]
    also = f', together with <b>{", ".join(others)}</b>' if others else ''
    alike = (
        f' This recording cannot tell it from {", ".join(verdict.inseparable)}.'
        if verdict.inseparable
        else ''
    )
    return (
        f'<b>{verdict.name}</b>: {SENTENCES[verdict.name]}{also} ({sure}). With it the error of '
        f'the held-out part falls from {errors["before"]:.1%} to {errors["after"]:.1%}; the noise '
        f'floor is {errors["noise_floor"]:.1%}, so {errors["gap_closed"]:.0%} of the gap is '
        f'closed.{alike}'
    )


def _figure(figure: Figure, caption: str) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format='png', dpi=110)
    picture = base64.b64encode(buffer.getvalue()).decode('ascii')
    return (
        f'<figure><img alt="{html.escape(caption)}" src="data:image/png;base64,{picture}">'
        f'<figcaption>{html.escape(caption)}</figcaption></figure>'
    )


def _plumes(result: 'Diagnosis') -> Figure:
    part, rig = result.held_out[0], result.recordings[0].rig
    extent = (0.0, rig.width_m, 0.0, rig.height_m)
    figure = Figure(figsize=(12, 5.2), layout='constrained')
    axes = figure.subplots(2, 3)
    last = -1
    shown = (
        ('observed', part.observed[last]),
        ('model before', part.before[last]),
        ('model after', part.after[last]),
    )
    for axis, (title, values) in zip(axes[0], shown, strict=True):
        image = axis.imshow(values, origin='lower', extent=extent, vmin=0, vmax=1, cmap='viridis')
        axis.set_title(f'{title}, {part.times[last] / 60:.0f} min', fontsize=10)
    figure.colorbar(image, ax=axes[0], label='tracer [-]', shrink=0.9)
    known = np.isfinite(part.observed)
    wrong = np.where(known, part.before - part.observed, 0.0)
    rms = np.sqrt(np.sum(wrong**2, axis=0) / np.maximum(known.sum(axis=0), 1))
    image = axes[1, 0].imshow(rms, origin='lower', extent=extent, cmap='magma', vmin=0, vmax=0.5)
    axes[1, 0].set_title('error before, held-out mean', fontsize=10)
    for axis, (title, values) in zip(axes[1, 1:], shown[1:], strict=True):
        difference = axis.imshow(
            values - part.observed[last],
            origin='lower',
            extent=extent,
            vmin=-0.5,
            vmax=0.5,
            cmap='RdBu_r',
        )
        axis.set_title(f'{title} − observed', fontsize=10)
    figure.colorbar(difference, ax=axes[1], label='difference [-]', shrink=0.9)
    for axis in axes.flat:
        _wells(axis, result)
    return figure


def _wells(axis: Any, result: 'Diagnosis') -> None:
    for name, well in result.recordings[0].rig.wells.items():
        axis.plot(well.x_m, well.z_m, 'o', ms=4, mfc='none', mec='0.6')
        axis.annotate(name, (well.x_m, well.z_m), fontsize=6, color='0.5')
    axis.tick_params(labelsize=7)


def _gap(result: 'Diagnosis') -> Figure:
    rig, part = result.recordings[0].rig, result.held_out[0]
    figure = Figure(figsize=(12, 4.0), layout='constrained')
    left, right = figure.subplots(1, 2, width_ratios=(1.5, 1))
    image = left.imshow(
        1e3 * result.gap.strength,
        origin='lower',
        extent=(0.0, rig.width_m, 0.0, rig.height_m),
        cmap='inferno',
    )
    figure.colorbar(image, ax=left, label='gap strength [1e-3/s]')
    for spot in result.gap.spots:
        left.add_patch(
            mpl.patches.Circle((spot.x, spot.z), spot.radius, fill=False, ec='w', lw=1.2)
        )
        left.annotate(f'{spot.share:.0%}', (spot.x, spot.z), color='w', fontsize=8, ha='center')
    centre = result.summary['where']['centre']
    if centre is not None:
        left.plot(centre['x_m'], centre['z_m'], 'c+', ms=16, mew=2)
    _wells(left, result)
    left.set(xlabel='x [m]', ylabel='z [m]')
    for values, name, colour in ((part.before, 'before', 'C3'), (part.after, 'after', 'C0')):
        known = np.where(np.isfinite(part.observed), part.observed, 0.0)
        wrong = np.where(np.isfinite(part.observed), values - part.observed, 0.0)
        error = np.sqrt(np.sum(wrong**2, axis=(1, 2)) / np.sum(known**2, axis=(1, 2)))
        right.plot(part.times / 60, 100 * error, color=colour, label=name)
    right.axhline(100 * part.noise_floor, color='0.4', ls='--', label='noise floor')
    right.set(xlabel='time [min]', ylabel='relative error [%]', ylim=(0, None))
    right.legend(frameon=False)
    return figure


def _table(head: list[str], rows: list[list[str]], numbers: set[int]) -> str:
    def row(cells: list[str], tag: str) -> str:
        marks = [' class="n"' if index in numbers else '' for index in range(len(cells))]
        joined = ''.join(
            f'<{tag}{mark}>{cell}</{tag}>' for mark, cell in zip(marks, cells, strict=True)
        )
        return f'<tr>{joined}</tr>'

    return f'<table>{row(head, "th")}{"".join(row(cells, "td") for cells in rows)}</table>'


def _ranking(result: 'Diagnosis') -> str:
    rows = []
    for effect in result.summary['effects']:
        parameters = ', '.join(
            f'{html.escape(name)} {_value(value)}' for name, value in effect['parameters'].items()
        )
        kept = effect['name'] in result.summary['combination']
        rows.append(
            [
                f'<b>{effect["name"]}</b>' if kept else effect['name'],
                'camera' if effect['name'] in CAMERA else 'physics',
                f'{effect["probability"]:.1%}',
                f'<span class="bar" style="width:{80 * effect["gap_closed"]:.0f}px"></span> '
                f'{effect["gap_closed"]:.0%}',
                parameters,
            ]
        )
    head = ['effect', 'of', 'probability', 'closes, alone', 'parameters (90 % interval)']
    return _table(head, rows, {2})


def _value(parameter: dict[str, Any]) -> str:
    value = parameter['value']
    if isinstance(value, str):
        return html.escape(value)
    unit = parameter.get('unit', '')
    unit = '' if unit in ('', '-') else f' {unit}'
    if parameter.get('low') is None:
        return f'{value:.3g}{unit}'
    return f'{value:.4g}{unit} ({parameter["low"]:.3g} … {parameter["high"]:.3g})'


def _phases(result: 'Diagnosis') -> str:
    rows = [
        [f'{phase.start / 60:.0f} – {phase.end / 60:.0f} min', phase.state, f'{phase.share:.0%}']
        for phase in result.gap.phases[:6]
    ]
    return _table(['time', 'pumps', 'share of the gap'], rows, {2})


def _checks(result: 'Diagnosis') -> str:
    names = [*result.verdict.members, *result.verdict.inseparable]
    if not names:
        return '<p>Nothing to check.</p>'
    items = ''.join(f'<li><b>{name}</b>: {CHECKS[name]}.</li>' for name in names)
    return f'<ul>{items}</ul>'


def _proposals(result: 'Diagnosis') -> str:
    if not result.proposals:
        return '<p>None needed.</p>'
    rows = []
    for proposal in result.proposals:
        gain = 'decides' if proposal.gain is None else f'× {proposal.gain:.1f}'
        rows.append([proposal.name, proposal.what, ' | '.join(proposal.separates), gain])
    head = ['experiment', 'what to do', 'separates', 'further apart']
    return _table(head, rows, {3})


def _strengths(result: 'Diagnosis') -> str:
    rows = [
        [name, str(entry['parameter']), f'{entry["value"]:.2g} {entry["unit"]}']
        for name, entry in sorted(result.strengths.items())
    ]
    note = '<p>Not seen is not absent: weaker effects than these leave no trace here.</p>'
    return note + _table(['effect', 'parameter', 'deviation that begins to show'], rows, {2})


def _method(result: 'Diagnosis') -> str:
    findings, sample = result.findings, result.samples[0]
    noise = sample.noise
    pairs = ''.join(
        f'<li>{html.escape(fit.label)}: misfit {score(fit):.2f}</li>' for fit in findings.pairs
    )
    tried = f'<p>Pairs judged:</p><ul>{pairs}</ul>' if pairs else ''
    numerics = result.numerics
    smear = (
        f'The configured model ({numerics.setting}) smears like a diffusion of '
        f'{numerics.model_diffusion:.2g} m²/s. '
        if numerics.found
        else ''
    )
    return (
        f'<p>{findings.runs} free-running simulations. Parameters were fitted to the first 70 % '
        'of the recording and judged on the last 30 %, always from the start, fed with nothing but '
        f'rates. Measured noise: grain {noise.grain:.1%}, frame {noise.frame:.1%}, empty sand '
        f'{noise.background:.1%}, correlated over {noise.correlation:.1f} cells. Misfit in noise '
        f'deviations at fronts: {score(findings.null):.2f} before, '
        f'{score(result.verdict.model):.2f} after; {findings.noise:.2f} is noise. '
        f'{smear}</p>{tried}'
    )
