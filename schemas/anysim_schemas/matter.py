"""Properties of an object beyond its shape: looks, drag, solver settings."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from anysim_schemas.base import Color, Fraction, Integer, Name, NonNegative, Spec
from anysim_schemas.values import ChoiceOf, NonNegativeValue

IMAGE_ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".tga")


class TextureSpec(Spec):
    """What is painted on an object: a pattern, made from a seed, or an image file.

    A bare string is the name of a pattern, or the URI of an image where it ends like one.
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("pattern", "colors", "seed", "resolution"), ("image",))

    pattern: Name | None = Field(
        default=None, description="a pattern by name, as `checker`; `anysim list textures` has them"
    )
    image: str | None = Field(default=None, description="URI of an image file (PNG, JPEG, BMP, TGA)")
    colors: tuple[Color, Color] | None = Field(
        default=None, description="the two colours of a pattern; its own where not given"
    )
    repeat: Annotated[Integer, Field(ge=1, le=64)] = Field(
        default=1, description="how many times it stands side by side on a face of the object"
    )
    seed: Annotated[Integer, Field(ge=0)] = Field(default=0, description="what is random in a pattern follows from it")
    resolution: Annotated[Integer, Field(ge=8, le=1024)] = Field(default=128, description="pixels along an edge")

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """A pattern, or the URI of an image."""
        return {"image" if text.lower().endswith(IMAGE_ENDINGS) else "pattern": text}

    @classmethod
    def text_means(cls) -> str:
        """What a bare string means, for editors."""
        return "{pattern: NAME}, or {image: URI} where it ends in " + ", ".join(IMAGE_ENDINGS)

    @model_validator(mode="after")
    def _exactly_one(self) -> "TextureSpec":
        if (self.pattern is None) == (self.image is None):
            raise ValueError(f"expected either pattern or image; got {'none' if self.pattern is None else 'both'}")
        return self


class MaterialSpec(Spec):
    """How a surface answers light: a preset by name, with what else is given on top. It changes no contact."""

    preset: Literal["matte", "plastic", "rubber", "metal", "glass", "wood", "ceramic", "lamp"] | None = Field(
        default=None, description="a material by name; matte where not given"
    )
    roughness: Fraction | None = Field(default=None, description="0 is a mirror, 1 is chalk")
    metallic: Fraction | None = Field(default=None, description="1: highlights have the colour of the surface")
    specular: Fraction | None = Field(default=None, description="strength of the highlights of what is no metal")
    emission: Fraction | None = Field(default=None, description="how far it shines by itself")
    opacity: Fraction | None = Field(default=None, description="1 hides what is behind it")

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """A preset."""
        return {"preset": text}


class DampingSpec(Spec):
    """How fast a body that nothing touches comes to rest: its speed falls as exp(-rate t)."""

    linear: NonNegativeValue = Field(default=0.0, description="rate at which the centre of mass slows down [1/s]")
    angular: NonNegativeValue = Field(default=0.0, description="rate at which it stops turning [1/s]")


class SolverSpec(Spec):
    """Settings of the contact solver for one object, where an engine has them; see `engine.options` for all at once."""

    position_iterations: Annotated[Integer, Field(ge=1, le=255)] | None = Field(
        default=None, description="iterations on positions; of bodies in contact the largest counts"
    )
    velocity_iterations: Annotated[Integer, Field(ge=0, le=255)] | None = Field(
        default=None, description="further iterations on velocities alone"
    )
    sleep_threshold: NonNegative | None = Field(
        default=None, description="kinetic energy per mass [J/kg] below which it may fall asleep; 0: never"
    )
    depenetration_speed: Annotated[NonNegative, Field(gt=0)] | None = Field(
        default=None, description="highest speed [m/s] at which it is pushed out of what it overlaps"
    )


TextureValue = ChoiceOf[TextureSpec]
MaterialValue = ChoiceOf[MaterialSpec]
