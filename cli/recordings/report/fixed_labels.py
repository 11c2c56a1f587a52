"""Labels of a figure that stay visible while the figure scrolls sideways on a phone.

The labels left of the graph are drawn a second time, in a column over the figure that does not
scroll. Pure.
"""

import re

SIZE = re.compile(r'viewBox="0 0 ([\d.]+) ([\d.]+)"')
TEXT = re.compile(r"<text\b.*?</text>", re.DOTALL)
X = re.compile(r'<text x="(-?[\d.]+)"')
LABEL = 'text-anchor="end"'  # of the ticks of the vertical axis, and of nothing else
SPACE = 4.0  # between the labels and the edge of their column


def chart(svg: str) -> str:
    """Return the HTML of a figure with its column of labels; without labels, of the figure."""
    size = SIZE.search(svg)
    texts = [(float(place[1]), text) for text in TEXT.findall(svg) if (place := X.match(text))]
    edges = [x for x, text in texts if LABEL in text]
    if size is None or not edges:
        return f'<div class="chart">{svg}</div>'
    width, height = float(size[1]), size[2]
    column = max(edges) + SPACE
    labels = "".join(text for x, text in texts if x < column)
    return (
        f'<div class="chart"><div class="labels" style="width: {100 * column / width:.2f}%" '
        f'aria-hidden="true"><svg xmlns="http://www.w3.org/2000/svg" '
        f'viewBox="0 0 {column:g} {height}">{labels}</svg></div>{svg}</div>'
    )
