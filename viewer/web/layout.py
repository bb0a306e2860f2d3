"""The page: picture, list of parts, sliders and buttons. Names are only ever inserted as text."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

from .app import AREA, App

TITLE = "ResFit"
PARTS = "part in parts"
KEY = "part.item + '/' + part.name"

SHOWN = "shown in typing.editor ? [typing.editor] : editor ? [editor] : []"
"""The editor on the page: that of a field that is being filled in, whatever is selected meanwhile."""

SELECT = "asked = Math.max(asked, answered) + 1; trigger('select', [part.item, part.name])"
"""Until it is answered, the numbers of the part that was selected before cannot be changed by mistake."""

THEME = {
    "theme": {
        "defaultTheme": "resfit",
        "themes": {
            "resfit": {
                "dark": False,
                "colors": {
                    "background": "#d5d8dd", "surface": "#f7f8f9", "primary": "#3b6ea8", "secondary": "#6a717b",
                },
            }
        },
    }
}  # fmt: skip


def build_page(server: Any, app: App) -> None:
    """Lay out the page of a trame server."""
    from trame.ui.vuetify3 import VAppLayout
    from trame.widgets import client, html

    server.state.trame__title = TITLE
    with VAppLayout(server, vuetify_config=THEME) as layout:
        own = files("resfit.viewer.web")
        client.Style((own / "style.css").read_text(encoding="utf-8"))
        client.Script((own / "keys.js").read_text(encoding="utf-8"))
        with layout.root, html.Div(classes="page"):
            with html.Div(classes="stage", raw_attrs=[':data-resting="resting"']):
                _picture(app)
                _switches()
            with html.Aside(classes="panel"):
                _heading()
                _parts()
                _editor()
                _files()
        _save_dialog()


def _picture(app: App) -> None:
    from trame.widgets import html, rca

    area = rca.RemoteControlledArea(name=AREA, display="image", event_throttle_ms=20, classes="picture")
    area.add_view_handler(app)
    html.Div("{{ message }}", classes="message", v_if="message", role="status")


def _switches() -> None:
    """Switches of the view, below the picture."""
    from trame.widgets import html

    with html.Div(classes="below"):
        with html.Div(classes="rows", v_if="view_rows.length"):
            _slider_row("row in view_rows", part="null", editor="null")
        with html.Label(classes="rows row", v_if="step !== null", title="steps of the fit"):
            html.Span("step {{ step + 1 }}")
            html.Input(
                type="range", min=0, max=("last_step",), step=1, value=("step",), raw_attrs=["data-steps"],
                input="step = Number($event.target.value); trigger('step', [step])",
            )  # fmt: skip
            html.Small("of {{ last_step + 1 }}")
        with html.Div(classes="chips"):
            html.Button(
                "history", type="button", classes="chip", title="how the fit came about", v_if="has_steps",
                raw_attrs=[':aria-pressed="step !== null"'], click="trigger('step', [step === null ? 0 : null])",
            )  # fmt: skip
            html.Button(
                "{{ toggle.label }}",
                v_for="toggle in toggles",
                key="toggle.name",
                type="button",
                raw_attrs=[':aria-pressed="toggle.on"', ':data-switch="toggle.name"'],
                title=("toggle.about",),
                classes="chip",
                click="trigger('run', [toggle.name])",
            )
    with html.Div(classes="chips looks"):
        for name, label in (("frame", "fit"), ("front", "front"), ("side", "side"), ("top", "top")):
            _button(label, f"trigger('run', ['{name}'])", classes="chip")
        _button("{{ up }} up", "trigger('run', ['up'])", classes="chip", title="which axis points up")


def _heading() -> None:
    from trame.widgets import html

    with html.Header():
        with html.Div(classes="names"):
            html.H1("{{ title }}")
            html.P("{{ status }}", raw_attrs=["data-status"])
        _icon("mdi-undo", "undo", "trigger('run', ['undo'])", disabled="!can_undo")
        _icon("mdi-redo", "redo", "trigger('run', ['redo'])", disabled="!can_redo")


def _parts() -> None:
    from trame.widgets import html
    from trame.widgets import vuetify3 as vuetify

    with html.Ul(classes="parts"):
        _part_row()
    with html.Div(classes="tools"):
        _button("duplicate", "trigger('run', ['duplicate'])", disabled="!editor")
        _button("delete", "trigger('run', ['delete'])", disabled="!editor")
        with vuetify.VMenu():
            with (
                vuetify.Template(v_slot_activator="{ props }"),
                html.Button(
                    v_bind="props",
                    type="button",
                    classes="knob",
                    title="add a primitive in the middle of the view",
                ),
            ):
                html.Span("add …")
            with vuetify.VList(density="compact"):
                vuetify.VListItem(
                    title=("family",),
                    v_for="family in families",
                    key="family",
                    click="trigger('add', [family])",
                )
        _button("show all", "trigger('run', ['show_all'])")


def _part_row() -> None:
    """A part: its name selects it."""
    from trame.widgets import html

    chosen = "{ selected: part.selected, hidden: part.hidden }"
    with html.Li(v_for=PARTS, key=KEY, classes=(chosen,), raw_attrs=[':data-part="part.name"']):
        with html.Button(
            classes="name",
            type="button",
            title=("part.name",),
            click=SELECT,
        ):
            html.Span(classes="dot", style=("{ background: part.color }",))
            html.Span("{{ part.name }}", classes="text")
            html.Small("{{ part.owner }}", v_if="part.owner")
        _button("only", "trigger('only', [part.item, part.name])", classes="small")
        _icon(
            ("part.hidden ? 'mdi-eye-off-outline' : 'mdi-eye-outline'",), "hide or show",
            "trigger('hide', [part.item, part.name])",
        )  # fmt: skip


def _editor() -> None:
    from trame.widgets import html

    part = "[shown.item, shown.name]"
    with html.Div(classes="editor"):
        html.P("Click a part, here or in the picture, to edit it.", classes="hint", v_if="!editor")
        with html.Fieldset(v_for=SHOWN, disabled=("asked > answered",)):
            with html.Div(classes="part"):
                html.Input(
                    type="text", maxlength=200, title="name of the part", raw_attrs=['aria-label="name"'],
                    **_typed("'name'", "shown.name", f"trigger('rename', [{part}, typing.text])", "shown"),
                )  # fmt: skip
                html.Small("{{ shown.family }}")
            with html.Section(v_for="group in shown.groups", key="group.name"):
                html.H2("{{ group.name }}")
                _slider_row("row in group.rows", part, "shown")


def _slider_row(rows: str, part: str, editor: str) -> None:
    """A number: its slider, and a field to type it.

    Args:
        rows: which ones, for Vue.
        part, editor: expressions for the part that they are of, and for the editor that stays while one is changed.
    """
    from trame.widgets import html

    put = f"if (typing.text) row.value = Number(typing.text); trigger('type', [{part}, row.id, typing.text])"
    with html.Label(classes="row", v_for=rows, key="row.id", title=("row.about",)):
        html.Span("{{ row.label }}")
        html.Input(
            type="range", min=("row.low",), max=("row.high",), step=("row.step",), value=("row.value",),
            raw_attrs=[':data-slider="row.id"'],
            input=f"row.value = Number($event.target.value); typing = {{ editor: {editor} }}; "
            f"trigger('slide', [{part}, row.id, row.value, false])",
            change=f"trigger('slide', [{part}, row.id, Number($event.target.value), true]); typing = {{}}",
            blur="typing = {}",
        )  # fmt: skip
        html.Input(
            type="number", step="any", raw_attrs=[':data-value="row.id"'],
            **_typed("row.id", "Math.round(1e4 * row.value) / 1e4", put, editor),
        )  # fmt: skip
        html.Small("{{ row.unit }}")


def _typed(field: str, shown: str, send: str, editor: str) -> dict[str, Any]:
    """Attributes of a field whose text is its own while it is typed: Enter and leaving send it, Escape restores it.

    Args:
        field, shown: expressions for its name, and for what it shows otherwise.
        send: statements that send what was typed.
        editor: expression for the editor that stays meanwhile.
    """
    return {
        "value": (f"typing.field === {field} ? typing.text : {shown}",),
        "input": f"typing = {{ field: {field}, text: $event.target.value, editor: {editor} }}",
        "change": f"if (typing.field === {field}) {{ {send} }}; typing = {{}}",
        "blur": "typing = {}",
        "keydown_enter": "$event.target.blur()",
        "keydown_escape": "typing = {}; $event.target.blur()",
        "__events": [("keydown_enter", "keydown.enter"), ("keydown_escape", "keydown.escape")],
    }


def _files() -> None:
    from trame.widgets import html

    with html.Footer():
        _button("Save …", "save_dialog = true", classes="knob wide")
        _button(
            "Download", "utils.download(title + '.json', trigger('text'), 'application/json')", classes="knob wide",
            title="the edited assembly.json",
        )  # fmt: skip


def _save_dialog() -> None:
    from trame.widgets import html
    from trame.widgets import vuetify3 as vuetify

    save = "trigger('save', [save_name]); save_dialog = false"
    with (
        vuetify.VDialog(v_model=("save_dialog",), max_width=420),
        vuetify.VCard(title="Save the edited assembly"),
    ):
        with vuetify.VCardText():
            html.P("In the folder of the assembly, as", classes="hint")
            vuetify.VTextField(
                v_model=("save_name",), density="compact", variant="outlined", hide_details=True, autofocus=True,
                keydown_enter=save, __events=[("keydown_enter", "keydown.enter")],
                raw_attrs=["data-save", 'maxlength="100"'],
            )  # fmt: skip
        with vuetify.VCardActions():
            vuetify.VSpacer()
            vuetify.VBtn("Cancel", click="save_dialog = false")
            vuetify.VBtn("Save", color="primary", variant="flat", click=save)


def _button(text: str, click: str, classes: str = "knob", disabled: str = "", title: str = "") -> None:
    from trame.widgets import html

    more: dict[str, Any] = {"disabled": (disabled,)} if disabled else {}
    if title:
        more["title"] = title
    html.Button(text, type="button", classes=classes, click=click, **more)


def _icon(icon: Any, title: str, click: str, disabled: str = "") -> None:
    from trame.widgets import html
    from trame.widgets import vuetify3 as vuetify

    more: dict[str, Any] = {"disabled": (disabled,)} if disabled else {}
    with html.Button(type="button", classes="icon", title=title, click=click, **more):
        vuetify.VIcon(icon=icon, size="18")
