"""How Sphinx makes the site of the documentation; `scripts/docs` calls it."""

from docutils.nodes import SkipNode
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx

import adv2e

project = "adv2e"
version = release = adv2e.__version__
author = "the authors of adv2e"
copyright = f"{author}, MIT licence"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_heading_anchors = 4
myst_enable_extensions = ["deflist"]
smartquotes = False  # options begin with two dashes
html_theme = "furo"
html_title = f"adv2e {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_math_renderer = "mathml"
pygments_style = "default"

autodoc_typehints = "none"  # docstrings say them, with units
napoleon_google_docstring = False
napoleon_use_param = False  # types there are sentences, not names to be linked
napoleon_use_rtype = False
napoleon_use_ivar = True
nitpick_ignore_regex = [("py:class", "[a-z0-9]+|Path|Section")]  # words in types of attributes


def _inline(self, node):
    self.body.append(tex2mathml(node.astext()))
    raise SkipNode


def _block(self, node):
    self.body.append(f'<div class="equation">{tex2mathml(node.astext(), as_block=True)}</div>')
    raise SkipNode


def _signature(app, what, name, obj, options, signature, returned):
    return (signature or "").replace("<function <lambda>>", "...") or None, returned


def setup(app: Sphinx) -> None:
    """Write equations as MathML, which browsers show without a script and without network."""
    app.connect("autodoc-process-signature", _signature)
    app.add_html_math_renderer(
        "mathml", inline_renderers=(_inline, None), block_renderers=(_block, None)
    )
