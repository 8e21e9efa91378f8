! @run 0.3
! @line before
! @stop ERR_REFUNKPRC
MODULE Spot
    PROC main()
        TPWrite "before";
        SpotL p100, vmax, gun1, spot10, tool1;
        TPWrite "after";
    ENDPROC
ENDMODULE
