from setuptools import find_packages, setup

package_name = "my_arm"

setup(
    name=package_name,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + package_name]),
        ("share/" + package_name, ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The sim-action developers",
    maintainer_email="sim-action@users.noreply.github.com",
    description="A node that moves an arm through poses.",
    license="Apache-2.0",
    entry_points={"console_scripts": ["poses = my_arm.poses:main"]},
)
