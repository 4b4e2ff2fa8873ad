"""The files of a model before they mean anything: XML with places, values of its elements, packages and references."""
