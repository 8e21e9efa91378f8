! @run 0.3
! @line welding simulated
! @line done
MODULE Welding
    ! A program for a cell with an option this robot does not have: it runs where the option is not used.
    PERS seamdata seam1 := [0.5, 0.5, [5, 0, 24, 120], 0.5, 0, 10, 0, [5, 0, 24, 120], 0, 0, [0, 0, 0, 0], 0, 0];
    VAR bool isSimulated := TRUE;
    PROC main()
        IF isSimulated THEN
            TPWrite "welding simulated";
        ELSE
            ArcLStart p10, v1000, seam1, weld5, fine, tWeldGun;
        ENDIF
        TPWrite "done";
        Stop;
    ENDPROC
ENDMODULE
