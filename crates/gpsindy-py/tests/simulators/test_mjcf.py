"""Corrections within the text of an MJCF file."""

from __future__ import annotations

from gpsindy.following import mjcf

TEXT = """<mujoco>
  <default><joint damping="1"/></default>
  <worldbody>
    <body name="a">  <!-- first -->
      <joint name='one' damping = '0.1'/>
      <geom size="0.1"/>
      <body>
        <joint
          axis="0 1 0"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="one" joint="one" gear="2"/></actuator>
</mujoco>
"""


def test_only_what_is_set_changes():
    text = mjcf.Text(TEXT)
    text.set(text.find("joint", "one", 0), "damping", "0.25")
    assert text.text == TEXT.replace("damping = '0.1'", 'damping = "0.25"')
    text.set(text.find("joint", "one", 0), "frictionloss", "0.5")
    assert 'damping = "0.25" frictionloss="0.5"/>' in text.text
    assert "<!-- first -->" in text.text


def test_an_element_without_a_name_is_found_by_its_number_where_nothing_is_included():
    text = mjcf.Text(TEXT)
    text.set(text.find("joint", "joint_1", 1), "armature", "0.01")
    assert 'axis="0 1 0" armature="0.01"/>' in text.text
    included = mjcf.Text(TEXT.replace("<actuator>", '<include file="more.xml"/><actuator>'))
    assert included.find("joint", "joint_1", 1) is None
    assert included.find("joint", "one", 0) is not None
    assert text.find("actuator", "one", 0).tag == "motor"


def test_lines_go_behind_a_start_tag_and_comments_to_the_top():
    text = mjcf.Text(TEXT)
    text.insert(text.find("body", "a", 0), '<inertial mass="1"/>')
    assert '<body name="a">\n      <inertial mass="1"/>  <!-- first -->' in text.text
    text.comment(["a delay -- of 3 steps"])
    assert text.text.startswith("<mujoco>\n  <!-- a delay - - of 3 steps -->")
