"""Words of other languages and programs: heads of tables, units, months, time zones.

One table each: English, German, French, Swedish, Danish, Norwegian, Finnish, Icelandic, Spanish,
Italian, Portuguese, Dutch, Polish. All words stand in the form of `plain`: small, without accents,
with _ for spaces.
"""

import unicodedata
from collections.abc import Iterator

_SIGNS = str.maketrans(
    {
        **dict.fromkeys('\u2212\u2010\u2011\u2012\u2013\ufe63\uff0d', '-'),
        **dict.fromkeys('\u00a0\u2007\u2009\u202f\u2002\u2003', ' '),
        '\u2019': "'",
        '\ufeff': '',
        '\u200b': '',
        '\u200e': '',
    }
)
"""Signs that spreadsheets write for minus, space and apostrophe, and those that nobody sees."""

_LETTERS = str.maketrans({'ø': 'o', 'æ': 'ae', 'œ': 'oe', 'ł': 'l', 'đ': 'd', 'ð': 'd', 'þ': 'th'})
"""Letters that are no letter with an accent."""

NAMES: dict[str, tuple[str, ...]] = {
    'start': (
        'start', 'begin', 'start_time', 'starttidspunkt', 'startzeitpunkt', 'startdatum',
        'date_de_debut', 'begin_time', 'beginn', 'anfang', 'startzeit', 'von',
        'debut', 'heure_de_debut', 'de', 'borjan', 'starttid', 'borjar', 'begynnelse', 'alku',
        'aloitus', 'fra', 'fran', 'inicio', 'inizio', 'comienzo', 'desde', 'da', 'starttijd',
        'aanvang', 'van', 'from', 'on', 'poczatek', 'upphaf',),
    'end': (
        'end', 'stop', 'end_time', 'sluttidspunkt', 'endzeitpunkt', 'enddatum', 'date_de_fin',
        'stop_time', 'ende', 'endzeit', 'bis', 'fin', 'heure_de_fin',
        'a', 'slut', 'sluttid', 'stopp', 'slutt', 'loppu', 'lopetus', 'til', 'till', 'final',
        'fine', 'hasta', 'einde', 'eindtijd', 'tot', 'to', 'until', 'off',
        'fim', 'ate', 'koniec', 'lok', 'endir',
    ),
    'datetime': (
        'datetime', 'date_time', 'timestamp', 'zeitstempel', 'zeitpunkt', 'horodatage',
        'date_heure', 'date_et_heure', 'tidsstempel', 'tidstampel', 'tidpunkt', 'tidspunkt',
        'aikaleima', 'fecha_hora', 'marca_de_tiempo', 'data_ora', 'tijdstempel', 'tijdstip',
        'datum_zeit', 'datum/zeit', 'datum/uhrzeit', 'date/time', 'date/heure',
    ),
    'time': (
        'time', 'times', 't', 'zeit', 'uhrzeit', 'temps', 'heure', 'tid', 'klokkeslett',
        'klockslag', 'klokkeslaet', 'aika', 'kello', 'kellonaika', 'tiempo', 'hora', 'tempo',
        'ora',
        'tijd', 'czas', 'godzina', 'timi',),
    'date': ('date', 'datum', 'dato', 'paivamaara', 'paivays', 'fecha', 'data', 'dag', 'tag',
             'day', 'dagsetning',),
    'duration': ('duration', 'dauer', 'duree', 'varaktighet', 'varighed', 'varighet', 'kesto',
                 'duracion', 'durata', 'duur'),
    'rate': (
        'rate', 'flow', 'rate_of_flow', 'injection_rate', 'pump_rate', 'infusion_rate',
        'pumperate',
        'pumpenrate', 'injektionsrate', 'forderstrom', 'volumenfluss', 'massenstrom',
        'flow_rate', 'flowrate', 'forderrate', 'flussrate',
        'pumprate', 'durchfluss', 'fluss', 'volumenstrom', 'debit', 'flode', 'flow_hastighed',
        'pumphastighet', 'pumpehastighed', 'strom', 'virtaus', 'virtaama', 'pumppausnopeus',
        'caudal', 'flujo', 'tasa', 'portata', 'flusso', 'debiet', 'stroming', 'pompsnelheid',
        'vazao', 'przeplyw', 'rennsli',
    ),
    'well': (
        'well', 'location', 'pump', 'port', 'brunnen', 'pumpe', 'ort', 'kanal', 'anschluss',
        'puits', 'pompe', 'lieu', 'position', 'brunn', 'brond', 'bronn', 'kaivo', 'pumppu', 'pozo',
        'bomba', 'pozzo', 'pompa', 'put', 'pomp', 'poco', 'studnia', 'hola', 'brunnur',),
    'concentration': (
        'concentration', 'maps', 'c', 'tracer', 'data', 'images', 'konzentration', 'konsentrasjon',
        'koncentration', 'pitoisuus', 'konsentraatio', 'concentracion', 'concentrazione',
        'concentratie', 'conc', 'konz', 'concentracao', 'stezenie', 'styrkur',),
    'density': ('density', 'density_kg/m3', 'density_kg_m3', 'dichte', 'densite',
                'masse_volumique', 'densitet', 'massefylde', 'tetthet', 'tiheys', 'densidad',
                'densita', 'dichtheid'),
    'path': ('path', 'file', 'filename', 'datei', 'dateiname', 'pfad', 'fichier', 'chemin', 'fil',
             'filnamn', 'filnavn', 'tiedosto', 'archivo', 'nombre_de_archivo', 'bestand',
             'bestandsnaam', 'bild', 'foto', 'photo', 'image', 'bilddatei'),
    'image_id': ('image_id', 'id', 'bildnummer', 'bild_nr', 'numero', 'image_number'),
    'x': ('x', 'location_x', 'x_position', 'x_koordinate'),
    'z': ('z', 'y', 'height', 'location_z', 'location_y', 'hohe', 'hauteur', 'hojd', 'hojde',
          'hoyde', 'korkeus', 'altura', 'altezza', 'hoogte'),
}  # fmt: skip
"""Heads of columns and names of arrays by quantity, the surest first."""

UNITS = {
    **dict.fromkeys(('pro', 'je', 'par', 'per', 'pr', 'por'), '/'),
    **dict.fromkeys(('std', 'stunde', 'stunden', 'heure', 'heures', 'timme', 'timmar', 'time',
                     'timer', 'tunti', 'tuntia', 'hora', 'horas', 'ora', 'ore', 'uur', 'hr', 'hrs',
                     'klst', 'godz',
                     't', 'u'), 'h'),
    **dict.fromkeys(('sek', 'sekunde', 'sekunden', 'seconde', 'secondes', 'sekund', 'sekunder',
                     'sekuntia', 'segundo', 'segundos', 'secondo', 'secondi', 'seconden', 'sec',
                     'secs'), 's'),
    **dict.fromkeys(('minute', 'minuten', 'minut', 'minuter', 'minutter', 'minuto', 'minutos',
                     'minuti', 'minuuttia', 'mn', 'mins'), 'min'),
    **dict.fromkeys(('tag', 'tage', 'jour', 'jours', 'dygn', 'dag', 'dage', 'dagar', 'dager',
                     'dagen', 'dia', 'dias', 'giorno', 'giorni', 'j', 'paiva', 'paivaa'), 'd'),
    **dict.fromkeys(('liter', 'litre', 'litres', 'liters', 'litri', 'litro', 'litros', 'litraa'),
                    'l'),
    **dict.fromkeys(('milliliter', 'millilitre', 'millilitres', 'mls'), 'ml'),
    **dict.fromkeys(('mikroliter', 'microliter', 'microlitre', 'mcl'), 'ul'),
    'ccm': 'cm3', 'cc': 'cm3', 'cbm': 'm3', 'kubikmeter': 'm3',
    **dict.fromkeys(('gr', 'gramm', 'gramme', 'grammes', 'gram'), 'g'),
    **dict.fromkeys(('prozent', 'pourcent', 'procent', 'prosent', 'prosenttia', 'por_ciento',
                     'percento', 'percent', 'pct'), '%'),
}  # fmt: skip
"""Words in units, and their meanings."""

_MONTHS = (
    'january janvier januar januari tammikuu enero gennaio janeiro styczen stycznia',
    'february fevrier februar februari helmikuu febrero febbraio fevereiro luty lutego',
    'march mars marz maerz marts maaliskuu marzo maart mrt marco marzec marca',
    'april avril huhtikuu abril aprile kwiecien kwietnia',
    'may mai maj toukokuu mayo maggio mei maio maja',
    'june juin juni kesakuu junio giugno junho czerwiec czerwca',
    'july juillet juli heinakuu julio luglio julho lipiec lipca',
    'august aout augusti elokuu agosto augustus agust sierpien sierpnia',
    'september septembre syyskuu septiembre settembre setembro wrzesien wrzesnia',
    'october octobre oktober lokakuu octubre ottobre outubro pazdziernik pazdziernika',
    'november novembre marraskuu noviembre novembro listopad listopada',
    'december decembre dezember desember joulukuu diciembre dicembre dezembro grudzien grudnia',
)

ZONES = {
    'Z': '+00:00', 'UTC': '+00:00', 'GMT': '+00:00', 'WET': '+00:00', 'WEST': '+01:00',
    'CET': '+01:00', 'MEZ': '+01:00', 'CEST': '+02:00', 'MESZ': '+02:00', 'EET': '+02:00',
    'EEST': '+03:00',
}  # fmt: skip
"""Offsets of time zones by the letters that one zone alone has."""


def with_plain_signs(text: str) -> str:
    """Return a text with the signs of a keyboard for minus, spaces and apostrophes."""
    return text.translate(_SIGNS)


def plain(text: str) -> str:
    """Return a text in small letters without accents, with _ for spaces."""
    spread = unicodedata.normalize('NFKD', with_plain_signs(text).casefold().translate(_LETTERS))
    letters = ''.join(sign for sign in spread if not unicodedata.combining(sign))
    return '_'.join(letters.split())


def month_of(name: str) -> int | None:
    """Return the number of a month by its name or the first letters of it; None for others."""
    begin = plain(name).strip('._')
    found = {
        number
        for number, names in enumerate(_MONTHS, start=1)
        if any(each.startswith(begin) for each in names.split())
    }
    return found.pop() if len(found) == 1 and len(begin) >= len('mai') else None


def quantities(title: str) -> Iterator[str]:
    """Yield the quantities that the head of a column, without its unit, may name."""
    word = plain(title)
    yield from (quantity for quantity, names in NAMES.items() if word in names)
